"""A plan of two samples for an arm with joints and one that is known by poses."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from basecal.cell import RobotState, Sample
from basecal.exchange.motions.way import RobotPath, make_path
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate

ARMS = simulate(Scenario(samples=3, joints=True), 0)
SPEED_RAD_S, HOLD_S = 0.5, 2.0


def of_joints(robot: str | None = None) -> RobotPath:
    """Both arms by joints."""
    samples = [Sample(20 + s.sample, robots=s.robots) for s in ARMS.recording.samples]
    return make_path(ARMS.cell, samples, robot, SPEED_RAD_S, HOLD_S)


def of_poses() -> RobotPath:
    """The hand by poses of its flange."""
    robots = {name: replace(robot, chain=None) for name, robot in ARMS.cell.robots.items()}
    poses = [SE3.from_rpy((0.1, 0.2, 0.3), (0.4, 0.0, 0.1 * k)) for k in range(2)]
    samples = [Sample(k, robots={"hand": RobotState(pose)}) for k, pose in enumerate(poses)]
    return make_path(replace(ARMS.cell, robots=robots), samples, "hand", SPEED_RAD_S, HOLD_S)


def joints_of(way: RobotPath, robot: str) -> np.ndarray:
    """(n, joints) as planned."""
    return np.array([sample.robots[robot].joints_rad for sample in way.samples])
