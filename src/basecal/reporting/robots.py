"""Estimates of the robots' own kinematics, in plain text."""

from __future__ import annotations

from basecal.cell import Calibration
from basecal.effects.registry import ROBOT_PARAMETERS


def robot_blocks(calibration: Calibration) -> list[list[str]]:
    """Lines of each robot's parameters, kind by kind, a heading first."""
    found = calibration.robot_parameters
    return [
        each.report(robot, values)
        for name, each in ROBOT_PARAMETERS.items()
        for robot, values in found.get(name, {}).items()
    ]
