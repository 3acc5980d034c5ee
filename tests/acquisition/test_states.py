"""States of arms as vectors."""

from __future__ import annotations

import numpy as np

from basecal.acquisition.states import ARRIVED_RAD_M, OFF_WAY_RAD, has_arrived, joint_off_way, state_vector
from basecal.cell import RobotState
from basecal.geometry import SE3


def test_a_vector_holds_all_of_a_state():
    """Joints stay as they are; a pose is its position and its rotation matrix."""
    assert state_vector(RobotState(joints_rad=np.array([1.0, 2.0]))).tolist() == [1.0, 2.0]
    pose = SE3.exp(np.array([0.1, 0.2, 0.3, 0.0, 0.0, 0.5]))
    np.testing.assert_array_equal(state_vector(RobotState(pose)), [*pose.translation, *pose.rotation.ravel()])


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
