"""Readings that no robot can give."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.acquisition.driver import Reading
from basecal.acquisition.plausible import check_reading
from basecal.cell import RobotState
from basecal.errors import DriverError
from basecal.geometry import SE3


def joints(*values):
    return Reading(1.0, RobotState(joints_rad=np.array(values, dtype=float)))


def pose(x_m, scale=1.0):
    return Reading(1.0, RobotState(SE3.adopt(scale * np.eye(3), np.array([x_m, 0.0, 0.0]))))


@pytest.mark.parametrize("reading", [joints(0.1, -999.0), pose(999.0), Reading(-5.0, joints(0.0).state)])
def test_a_possible_reading_is_accepted(reading):
    """Joints of many turns, far flanges and negative stamps are possible."""
    check_reading("eye", reading)


@pytest.mark.parametrize(
    ("reading", "problem"),
    [
        (joints(0.1, np.nan), "a number is not finite"),
        (joints(np.inf), "a number is not finite"),
        (joints(), "it has no joints"),
        (joints(0.0, 1e308), r"joint 2 is at 1e\+308 rad"),
        (joints(0.0, -1001.0), r"joint 2 is at -1e\+03 rad"),
        (pose(1001.0), r"the flange is 1e\+03 m from its base"),
        (pose(np.nan), "a number is not finite"),
        (pose(0.0, 2.0), "its rotation is none"),
        (Reading(np.nan, joints(0.0).state), "its stamp is nan"),
        (Reading(0.0, RobotState()), "expected joints or a pose"),
    ],
)
def test_an_impossible_reading_is_refused_with_its_number(reading, problem):
    """The error names the robot and the number."""
    with pytest.raises(DriverError, match=f"eye: implausible state: {problem}"):
        check_reading("eye", reading)
