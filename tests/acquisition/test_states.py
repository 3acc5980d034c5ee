"""States of arms as vectors."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.acquisition.driver import Reading
from basecal.acquisition.states import (
    ARRIVED_RAD_M,
    OFF_WAY_RAD,
    check_reading,
    has_arrived,
    joint_off_way,
)
from basecal.cell import RobotState
from basecal.errors import DriverError
from basecal.geometry import SE3


def test_an_arm_arrives_within_two_milliradians():
    """Just inside the limit it has arrived, just outside not; one joint that is off is enough."""
    goal = RobotState(joints_rad=np.zeros(3))
    for off, arrived in ((0.99, True), (1.01, False)):
        state = RobotState(joints_rad=np.array([0.0, off * ARRIVED_RAD_M, 0.0]))
        assert has_arrived(state, goal) is arrived


def test_a_joint_is_off_its_way_beyond_its_start_or_goal():
    """Between both it may be anywhere, whichever is larger; the joint that is farthest outside is named."""
    start, goal = np.array([0.0, 1.0]), np.array([1.0, 0.0])
    for fine in ([0.0, 1.0], [0.9, 0.9], [1.0 + 0.99 * OFF_WAY_RAD, -0.99 * OFF_WAY_RAD]):
        assert joint_off_way(np.array(fine), start, goal, OFF_WAY_RAD) is None
    joint, beyond_rad = joint_off_way(np.array([1.1, -0.2]), start, goal, OFF_WAY_RAD)
    assert (joint, round(beyond_rad, 9)) == (1, 0.2)


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
