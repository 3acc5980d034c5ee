"""What was found of the robots' own kinematics, in plain text."""

from __future__ import annotations

from basecal.cell import Calibration
from basecal.cell.robot_parameters.kind import robot_parameter_kinds


def robot_blocks(calibration: Calibration) -> list[list[str]]:
    """Lines of each robot's parameters, kind by kind, a heading first."""
    kinds = robot_parameter_kinds()
    found = calibration.robot_parameters
    return [kinds[kind].report(robot, of) for kind in kinds for robot, of in found.get(kind, {}).items()]
