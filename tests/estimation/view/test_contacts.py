"""Tests of contacts other than a point at a point."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.estimation.view.contacts import EdgeMeasurement, GripMeasurement, HingeMeasurement, PlaneMeasurement
from basecal.estimation.view.measurement import Noise
from basecal.geometry import SE3

KINDS = (PlaneMeasurement, EdgeMeasurement, HingeMeasurement, GripMeasurement)


def make_contacts(kind, count=4):
    """Contacts of a kind, with unstated noise."""
    zero = np.zeros((count, 1))
    return kind(np.zeros((1, 3)), np.zeros((count, 1, 3)), np.ones((count, 1), dtype=bool), zero, zero)


@pytest.mark.parametrize("kind", KINDS)
def test_gradient_equals_differences_of_the_cost(kind):
    """Central differences along each direction of the tangent agree, far from contact."""
    rng = np.random.default_rng(0)
    contacts = make_contacts(kind).with_noise(Noise(touch_m=0.3, grip_rad=0.2))
    pose = SE3.exp(rng.normal(0, 0.6, (4, 6)))
    found, step = contacts.linearise(pose, None, False), 1e-6
    for k, along in enumerate(np.eye(6)):
        ahead, behind = (contacts.linearise(pose @ SE3.exp(s * step * along), None, False).cost for s in (1, -1))
        np.testing.assert_allclose(2 * found.gradient[:, k], (ahead - behind) / (2 * step), rtol=1e-6, atol=1e-6)
    assert np.all(np.linalg.matrix_rank(found.information) == kind.coordinates)


@pytest.mark.parametrize("kind", KINDS)
def test_target_gauges_change_no_residual(kind):
    """At contact, moves of a target along its gauge directions leave residuals zero."""
    for along in np.diag(kind.target_gauge)[np.array(kind.target_gauge) > 0]:
        np.testing.assert_allclose(make_contacts(kind, 1).residuals(SE3.exp(0.3 * along[None]), None), 0, atol=1e-12)


def test_unstated_noise_is_counted_by_its_field():
    """Positions count as `touch_m`, directions as `grip_rad`, with as many equations as a contact has."""
    assert make_contacts(PlaneMeasurement).counts() == {"stated": 0, "touch_m": 4}
    assert make_contacts(HingeMeasurement).counts() == {"stated": 0, "grip_rad": 8}


@pytest.mark.parametrize(("kind", "start", "parts"), [
    (PlaneMeasurement, [0.2, -0.3, 0, 0, 0, 0.7], slice(0, 6)), (EdgeMeasurement, [0, 0, 0.3, 0, 0, 0.5], slice(0, 6)),
    (HingeMeasurement, [0.1, 0.2, 0.3, 0, 0, 0.5], slice(3, 6)),
])  # fmt: skip
def test_all_other_target_moves_are_observable(kind, start, parts):
    """From a contact away from the target's origin, only moves along the gauges leave residuals zero."""
    contact, pose = make_contacts(kind, 1), SE3.exp(np.array([start], dtype=float))
    np.testing.assert_allclose(contact.residuals(pose, None), 0, atol=1e-12)
    moved = [np.abs(contact.residuals(pose @ SE3.exp(0.3 * along[None]), None)).max() > 1e-3 for along in np.eye(6)]
    assert moved[parts] == [not held for held in kind.target_gauge[parts]]


def test_hinge_rotates_about_its_axis_at_either_end():
    """Moves of the camera's end along and about its z axis leave residuals zero, and other rotations do not."""
    contact, pose = make_contacts(HingeMeasurement, 1), SE3.exp(np.array([[0.1, 0.2, 0.3, 0, 0, 0.5]]))
    moved = [np.abs(contact.residuals(SE3.exp(0.3 * along[None]) @ pose, None)).max() > 1e-3 for along in np.eye(6)]
    assert moved == [False, False, False, True, True, False]
    assert [not held for held in HingeMeasurement.camera_gauge[3:]] == moved[3:]
