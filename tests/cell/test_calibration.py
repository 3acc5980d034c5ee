"""What came out of a calibration, by name."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.cell import Calibration, RobotParameters
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


def test_what_was_found_of_a_robot():
    """By kind, of one robot; nothing of one that was not calibrated."""
    offsets = RobotParameters(("a",), np.zeros(1), np.ones(1), np.ones(1, dtype=bool))
    calibration = Calibration("good", robot_parameters={"joint_offsets": {"eye": offsets}, "deflection": {}})
    assert calibration.parameters_of("eye") == {"joint_offsets": offsets}
    assert calibration.parameters_of("hand") == {}
