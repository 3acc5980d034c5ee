"""What came out of a calibration, by name."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.cell import Calibration
from basecal.cell.calibration import JointOffsets
from basecal.errors import FrameNotFound
from basecal.geometry import SE3, PoseEstimate


def test_transforms_are_found_by_name():
    """One that was not found is an error that lists those that were."""
    estimate = PoseEstimate.exact(SE3.identity())
    calibration = Calibration("good", {"a_from_b": estimate})
    assert calibration["a_from_b"] is estimate
    with pytest.raises(FrameNotFound, match=r"no 'a_from_c' .*there are: a_from_b"):
        calibration["a_from_c"]
    with pytest.raises(KeyError):
        Calibration("refused")["a_from_b"]


def test_sigmas_of_joint_offsets_are_roots_of_the_covariance():
    """Per joint [rad]; NaN where nothing is known."""
    covariance = np.diag([4e-6, 9e-6, np.nan])
    covariance[0, 1] = covariance[1, 0] = 1e-6
    offsets = JointOffsets(("a", "b", "c"), np.zeros(3), covariance, np.ones(3, dtype=bool))
    np.testing.assert_allclose(offsets.sigma_rad, [2e-3, 3e-3, np.nan])
