"""States that bring a flange to a pose."""

from __future__ import annotations

from basecal.cell import Robot, RobotState
from basecal.errors import NotConverged
from basecal.geometry import SE3
from basecal.kinematics.inverse import inverse


def reach_pose(robot: Robot, base_from_flange: SE3, neighbour: RobotState) -> RobotState | None:
    """The state near another one that brings the flange there; None if the arm does not reach.

    Args:
        robot: The robot.
        base_from_flange: Where to.
        neighbour: In the kind that the robot is sent by: joints, or a pose, which is taken as it is.
    """
    if neighbour.joints_rad is None or robot.chain is None:
        return RobotState(base_from_flange)
    try:
        return RobotState(joints_rad=inverse(robot.chain, base_from_flange, neighbour.joints_rad))
    except NotConverged:
        return None
