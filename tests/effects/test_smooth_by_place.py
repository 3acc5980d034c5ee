"""Tests of errors that are smooth in the position of a flange, along the axes of its base."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.effects.smooth import LENGTH_M
from basecal.effects.smooth_by_place import errors, kernel
from basecal.geometry import SE3
from shared.absorbed_errors import absorb_errors


def test_errors_depend_on_position_not_orientation():
    """In the base frame the covariances of all coordinates are the kernel.

    Rotating the flange changes only its axes.
    """
    rng = np.random.default_rng(0)
    poses = SE3.exp(rng.uniform(-0.6, 0.6, (12, 6)))
    found = errors(poses, poses)
    in_base = np.kron(np.eye(2), poses.rotation) @ found.by_stop
    alike = np.einsum("iak,jbk->abij", in_base, in_base)
    expected = kernel(poses, poses)
    for a in range(6):
        for b in range(6):
            np.testing.assert_allclose(alike[a, b], expected * (a == b), atol=0.05)
    turned = SE3(SE3.exp(rng.uniform(-1, 1, (12, 6))).rotation, poses.translation)
    np.testing.assert_allclose(kernel(poses, turned), expected)
    apart = np.linalg.norm(poses.translation[0] - poses.translation[1])
    assert np.isclose(expected[0, 1], np.exp(-0.5 * (apart / LENGTH_M) ** 2))


@pytest.mark.journey
def test_covariance_includes_error_absorbed_by_base():
    """Errors of 2 mm and 2 mrad shift the base by millimetres.

    Their change over the samples shows this, so the covariance includes it.
    """
    weights = 2e-3 * np.random.default_rng(0).standard_normal((6, 3))

    def recorded_pose(pose: SE3) -> SE3:
        """Return the pose that is recorded."""
        shift, turn = np.split(weights @ np.sin(4 * pose.translation), 2)
        return SE3(SE3.exp(np.append(0 * turn, turn)).rotation @ pose.rotation, pose.translation + shift)

    names, integrated, alone = absorb_errors(30, 1, recorded_pose)
    assert names == ["smooth_by_place"]
    assert integrated < 20
    assert alone > 50
