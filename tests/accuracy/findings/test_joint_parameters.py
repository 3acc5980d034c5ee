"""Tests of findings about joint offsets and compliances that the data do not determine, each with its reason."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import pytest

from basecal.accuracy.findings.joint_parameters import unobserved_joint_parameters
from basecal.estimation.solve import solve
from basecal.simulation import Scenario, simulate

ARMS = Scenario(samples=15, joints=True)
PRIOR = {"joint_offset_rad": 0.004, "joint_offsets": "prior"}


def findings_by_robot(**scenario):
    """Findings by robot."""
    made = simulate(replace(ARMS, **scenario), 0)
    of = SimpleNamespace(cell=made.cell, solution=solve(made.cell, made.recording))
    return {f.about[0]: f for f in unobserved_joint_parameters(of)}


def test_first_and_last_offset_rest_on_prior():
    """The first joint acts as the base and the last as the mounts, so only priors determine their offsets.

    The sigmas of the bases contain the uncertainty.
    """
    found = findings_by_robot(**PRIOR)
    start = "offsets known from their prior alone: joints 1 (shoulder_pan) and 6 (wrist_3): "
    why = "the first joint moves the arm as its base does, the last one as the mounts on its flange do; "
    left = "the sigmas of {} and of the mounts contain the remaining uncertainty"
    bases = {"eye": "the other bases", "hand": "eye_base_from_hand_base"}
    assert {name: f.message for name, f in found.items()} == {
        name: f"{name}: {start}{why}{left.format(base)}." for name, base in bases.items()
    }
    assert {(f.code, f.severity) for f in found.values()} == {("prior-dominated", "info")}


def test_unobservable_free_offsets_are_fixed_gauges():
    """Unobservable free offsets are fixed at zero as gauges; other joints of a still arm hardly move alone."""
    free = {**PRIOR, "joint_offsets": "free", "camera_mount": "fixed"}
    found = findings_by_robot(**free, arms="eye_still")
    assert {f.code for f in found.values()} == {"fixed-gauge"}
    assert (
        "offsets that are unobservable and fixed at zero as a gauge: joints 1 (shoulder_pan), 2 ("
        in found["eye"].message
    )
    assert "the samples hardly move the others alone; the other bases and the mounts compensate" in found["eye"].message
    assert "hardly move" not in found["hand"].message
    assert "eye_base_from_hand_base and the mounts compensate" in found["hand"].message


def test_observable_offsets_are_not_reported():
    """With base and mounts known, every offset is observable and none is reported."""
    assert findings_by_robot(**PRIOR, base="fixed", camera_mount="fixed", target_mount="fixed") == {}
    assert findings_by_robot() == {}


@pytest.mark.parametrize(("status", "code", "how"), [
    ("prior", "prior-dominated", "known from their prior alone"), ("free", "fixed-gauge", "that are unobservable"),
])  # fmt: skip
def test_compliances_invisible_to_gravity_are_reported(status, code, how):
    """Compliances that gravity does not show are reported, always that of the upright first joint."""
    found = findings_by_robot(compliance=1e-4, deflection=status)
    for robot, finding in found.items():
        assert (finding.code, finding.severity) == (code, "info")
        assert finding.message.startswith(f"{robot}: compliances {how}: joint")
        assert "1 (shoulder_pan)" in finding.message
        assert finding.message.endswith(
            "the torque of gravity about them is small in these samples, or the same in all of them."
        )
    assert found.keys() == {"eye", "hand"}


def test_single_unobservable_joint_is_in_singular():
    """With the camera mount fixed, only the first offset of the eye is open, and the message is in the singular."""
    found = findings_by_robot(**PRIOR, camera_mount="fixed")
    assert "alone: joint 1 (shoulder_pan): the first joint moves" in found["eye"].message


def test_link_parameters_name_no_joints():
    """Link parameters have no finding by joint."""
    assert findings_by_robot(link_error=(1e-4, 2e-4), link_parameters="prior", samples=8) == {}
