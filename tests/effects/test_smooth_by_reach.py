"""Tests of errors that are smooth in the reach and height of a flange, along axes that rotate with the arm."""

from __future__ import annotations

import numpy as np

from basecal.effects.smooth import LENGTH_M
from basecal.effects.smooth_by_reach import errors, kernel
from basecal.geometry import SE3
from shared.absorbed_errors import absorb_errors


def test_rotation_about_first_axis_keeps_errors():
    """Rotating the arm about its first axis leaves all errors unchanged at the flange, including the bend.

    A longer reach or another height changes them.
    """
    poses = SE3.exp(np.random.default_rng(0).uniform(-0.6, 0.6, (12, 6)))
    turned = SE3.exp(np.array([0, 0, 0, 0, 0, 1.3])) @ poses
    np.testing.assert_allclose(errors(poses, turned).by_stop, errors(poses, poses).by_stop, atol=1e-9)
    np.testing.assert_allclose(np.diag(kernel(poses, turned)), 1.0)
    for shift in ([0.2, 0, 0], [0, 0, 0.2]):
        at, there = (SE3(np.eye(3)[None], np.array([place])) for place in ([0.5, 0, 0.1], np.add([0.5, 0, 0.1], shift)))
        assert np.isclose(kernel(at, there)[0, 0], np.exp(-0.5 * (0.2 / LENGTH_M) ** 2))


def test_errors_follow_arm_axes_and_last_is_bend():
    """In the arm's axes the covariances are the kernel; the last error rotates the base sideways by the reach."""
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


def test_covariance_includes_long_link_absorbed_by_base():
    """A link 3 mm too long shifts the flange outward and upward.

    The base absorbs this, and the covariance includes it.
    """

    def recorded_pose(pose: SE3) -> SE3:
        """Return the pose that is recorded."""
        outward = pose.translation * [1, 1, 0] / np.linalg.norm(pose.translation[:2])
        return SE3(pose.rotation, pose.translation + 3e-3 * outward + [0, 0, 2e-3])

    names, integrated, alone = absorb_errors(24, 1, recorded_pose)
    assert names == ["smooth_by_reach"]
    assert integrated < 20
    assert alone > 50
