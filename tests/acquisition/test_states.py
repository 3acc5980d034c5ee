"""States of arms as vectors."""

from __future__ import annotations

import numpy as np

from basecal.acquisition.states import ARRIVED_RAD_M, has_arrived, state_vector
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
