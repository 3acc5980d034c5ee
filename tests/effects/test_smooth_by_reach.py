"""Errors that are smooth in the reach and height of a flange, along axes that turn with the arm."""

from __future__ import annotations

import numpy as np

from basecal.effects.smooth import LENGTH_M
from basecal.effects.smooth_by_reach import errors, kernel
from basecal.geometry import SE3
from shared.absorbed_errors import absorb_errors


def test_turning_the_arm_about_its_first_axis_changes_nothing_at_the_flange():
    """All errors, the bend among them, move the flange equally; a longer reach or another height does not."""
    poses = SE3.exp(np.random.default_rng(0).uniform(-0.6, 0.6, (12, 6)))
    turned = SE3.exp(np.array([0, 0, 0, 0, 0, 1.3])) @ poses
    np.testing.assert_allclose(errors(poses, turned).by_stop, errors(poses, poses).by_stop, atol=1e-9)
    np.testing.assert_allclose(np.diag(kernel(poses, turned)), 1.0)
    for shift in ([0.2, 0, 0], [0, 0, 0.2]):
        at, there = (SE3(np.eye(3)[None], np.array([place])) for place in ([0.5, 0, 0.1], np.add([0.5, 0, 0.1], shift)))
        assert np.isclose(kernel(at, there)[0, 0], np.exp(-0.5 * (0.2 / LENGTH_M) ** 2))


def test_errors_are_along_the_axes_of_the_arm_and_the_last_bends_it():
    """In these axes covariances of all coordinates are the kernel; the bend turns the base side by the reach."""
    poses = SE3.exp(np.random.default_rng(0).uniform(-0.6, 0.6, (12, 6)))
    found = errors(poses, poses)
    x, y, _ = poses.translation.T
    in_arm = SE3.exp(np.outer(-np.arctan2(y, x), [0, 0, 0, 0, 0, 1])).rotation @ poses.rotation
    along = np.kron(np.eye(2), in_arm) @ found.by_stop[..., :-1]
    alike = np.einsum("iak,jbk->abij", along, along)
    np.testing.assert_allclose(alike, np.eye(6)[:, :, None, None] * kernel(poses, poses), atol=0.05)
    size = 1e-6
    bent = SE3.exp(size * np.stack([0 * x, 0 * x, 0 * x, y, -x, 0 * x], axis=-1)) @ poses
    np.testing.assert_allclose(size * found.by_stop[..., -1], (poses.inverse() @ bent).log(), atol=1e-10)
    assert found.is_turn[-1]


def test_a_long_link_shows_and_its_part_of_the_base_is_in_the_covariance():
    """Of 3 mm: the flange is shifted outward and up alike, which the base takes up."""

    def wrong(pose: SE3) -> SE3:
        """The pose that is recorded."""
        outward = pose.translation * [1, 1, 0] / np.linalg.norm(pose.translation[:2])
        return SE3(pose.rotation, pose.translation + 3e-3 * outward + [0, 0, 2e-3])

    names, integrated, alone = absorb_errors(24, 1, wrong)
    assert names == ["smooth_by_reach"]
    assert integrated < 20
    assert alone > 50
