"""States of arms as vectors, and whether an arm has arrived where it was sent."""

from __future__ import annotations

import numpy as np

from basecal.cell import RobotState
from basecal.geometry import Array

ARRIVED_RAD_M = 2e-3
"""Distance from its goal at which an arm counts as arrived: controllers round, and some stop a little short."""


def state_vector(state: RobotState) -> Array:
    """Joints [rad], or position [m] and rotation matrix of a pose."""
    if state.joints_rad is not None:
        return state.joints_rad
    pose = state.base_from_flange
    assert pose is not None
    return np.concatenate([pose.translation, pose.rotation.ravel()])


def has_arrived(state: RobotState, goal: RobotState) -> bool:
    """Whether an arm is where it was sent."""
    return bool(np.abs(state_vector(state) - state_vector(goal)).max() < ARRIVED_RAD_M)


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
