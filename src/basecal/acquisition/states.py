"""States of arms as vectors, and whether an arm has arrived where it was sent."""

from __future__ import annotations

import numpy as np

from basecal.acquisition.driver import Reading
from basecal.cell import RobotState
from basecal.errors import DriverError
from basecal.geometry import Array

ARRIVED_RAD_M = 2e-3
"""Distance from its goal at which an arm counts as arrived: controllers round, and some stop a little short."""
_LARGEST_JOINT_RAD = 1e3  # of a joint: 159 turns, more than any counter of turns
_LARGEST_DISTANCE_M = 1e3  # of a flange from its base
_ROTATION_TOLERANCE = 1e-3  # by which a rotation matrix may miss orthonormality: printed numbers are rounded


def has_arrived(state: RobotState, goal: RobotState) -> bool:
    """Whether an arm is where it was sent."""
    return bool(np.abs(state.vector - goal.vector).max() < ARRIVED_RAD_M)


OFF_WAY_RAD = 0.05
"""By which a joint may leave the range between start and goal: more than overshoot, play and noise of any arm."""


OFF_PLACE_RAD = 0.01
"""By which a joint may leave the place where it arrived: more than noise and settling, less than a push."""


def joint_off_way(joints_rad: Array, start_rad: Array, goal_rad: Array, limit_rad: float) -> tuple[int, float] | None:
    """The joint that is farthest outside of the range between its start and its goal, and by how much [rad].

    None if each joint is within that range, to a limit. All arrays are (joints,).
    """
    beyond = np.maximum(np.minimum(start_rad, goal_rad) - joints_rad, joints_rad - np.maximum(start_rad, goal_rad))
    worst = int(np.argmax(beyond))
    return (worst, float(beyond[worst])) if beyond[worst] > limit_rad else None


def check_reading(name: str, reading: Reading) -> None:
    """Refuse a reading that no robot can give.

    Raises:
        DriverError: if a number is not finite, a joint is beyond 1000 rad, or a flange is beyond 1 km.
    """
    if problem := _problem(reading):
        raise DriverError(
            f"{name}: implausible state: {problem}. The controller or its driver sends wrong numbers. "
            f"Check the driver's units and what the controller shows"
        )


def _problem(reading: Reading) -> str:
    if (reading.state.joints_rad is None) == (reading.state.base_from_flange is None):
        return "expected joints or a pose of the flange, one of them"
    values = reading.state.vector
    if not np.isfinite(reading.stamp_s):
        return f"its stamp is {reading.stamp_s}"
    if not values.size:
        return "it has no joints"
    if not np.all(np.isfinite(values)):
        return f"a number is not finite: {values}"
    if reading.state.joints_rad is not None:
        worst = int(np.argmax(np.abs(values)))
        return f"joint {worst + 1} is at {values[worst]:.3g} rad" if abs(values[worst]) > _LARGEST_JOINT_RAD else ""
    if (distance_m := float(np.abs(values[:3]).max())) > _LARGEST_DISTANCE_M:
        return f"the flange is {distance_m:.3g} m from its base"
    rotation = values[3:].reshape(3, 3)
    return "" if np.abs(rotation @ rotation.T - np.eye(3)).max() < _ROTATION_TOLERANCE else "its rotation is none"
