"""Plans of two or three samples: for arms with joints, and for one that is known by poses."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from basecal.cell import RobotState, Sample
from basecal.exchange.motions.way import RobotPath, make_path
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate

ARMS = simulate(Scenario(samples=3, joints=True), 0)
SPEED_RAD_S, HOLD_S = 0.5, 2.0


def joint_way(robot: str | None = None) -> RobotPath:
    """The way of both arms, or of one, by joints."""
    samples = [Sample(20 + s.sample, robots=s.robots) for s in ARMS.recording.samples]
    return make_path(ARMS.cell, samples, robot, SPEED_RAD_S, HOLD_S)


def pose_way() -> RobotPath:
    """The way of the hand by poses of its flange."""
    robots = {name: replace(robot, chain=None) for name, robot in ARMS.cell.robots.items()}
    poses = [SE3.from_rpy((0.1, 0.2, 0.3), (0.4, 0.0, 0.1 * k)) for k in range(2)]
    samples = [Sample(k, robots={"hand": RobotState(pose)}) for k, pose in enumerate(poses)]
    return make_path(replace(ARMS.cell, robots=robots), samples, "hand", SPEED_RAD_S, HOLD_S)


def planned_joints(way: RobotPath, robot: str) -> np.ndarray:
    """Planned joints of a robot, (n, joints)."""
    return np.array([sample.robots[robot].joints_rad for sample in way.samples])
