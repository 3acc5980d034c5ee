"""States that bring a flange to a pose."""

from __future__ import annotations

import numpy as np

from basecal.cell import Robot, RobotState
from basecal.geometry import SE3
from basecal.planning.reach import reach_pose
from basecal.simulation.running.ur5e import ur5e

ARM = Robot("eye", chain=ur5e())
NEAR = RobotState(joints_rad=np.array([0.3, -1.3, -1.8, -3.0, -1.2, 3.0]))


def test_joints_near_those_it_has():
    """A pose a little away is reached by joints a little away, to 1e-9."""
    there = ur5e().forward(NEAR.joints_rad) @ SE3.exp(np.array([0.05, -0.02, 0.03, 0.1, 0.0, -0.1]))
    found = reach_pose(ARM, there, NEAR)
    assert np.abs((ur5e().forward(found.joints_rad).inverse() @ there).log()).max() < 1e-9
    assert np.abs(found.joints_rad - NEAR.joints_rad).max() < 0.5


def test_out_of_reach_and_by_poses():
    """Two metres away there are none; a robot that is sent to poses is sent there."""
    far = SE3(np.eye(3), np.array([2.0, 0, 0]))
    assert reach_pose(ARM, far, NEAR) is None
    assert reach_pose(Robot("eye"), far, RobotState(SE3.identity())).base_from_flange is far
