"""Two arms seen as points, and what may go wrong while they are captured."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from basecal.cell import Cell, RobotState, Sample
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate

BASE = "eye_base_from_hand_base"


def recorded(samples: int = 10, joints: bool = False) -> tuple[Cell, list[Sample]]:
    """A cell of arms in order that record poses or joints, and its samples; nobody states any noise."""
    noise = {"robot_noise": (5e-5, 1e-4), "state_robot_noise": False}
    made = simulate(Scenario(samples=samples, joints=joints, **noise), 0)
    return made.cell, list(made.recording.samples)


def with_views_of(samples: Sequence[Sample], place: int, other: int) -> list[Sample]:
    """The samples, of which one has what was seen at the pose of another."""
    late = replace(samples[place], observations=samples[other].observations)
    return [*samples[:place], late, *samples[place + 1 :]]


def with_hand_base_moved(samples: Sequence[Sample], shift_m: float, since: int) -> list[Sample]:
    """The samples, before one of which the base of `hand` was moved along its first axis."""
    moved = SE3(np.eye(3), np.array([-shift_m, 0.0, 0.0]))
    after = [_at(s, "hand", RobotState(moved @ s.robots["hand"].base_from_flange)) for s in samples[since:]]
    return [*samples[:since], *after]


def with_joint_off(samples: Sequence[Sample], robot: str, joint: int, rad: float) -> list[Sample]:
    """The samples, in all of which a joint is recorded so much larger."""
    off = np.zeros(6)
    off[joint] = rad
    return [_at(s, robot, RobotState(joints_rad=s.robots[robot].joints_rad + off)) for s in samples]


def _at(sample: Sample, robot: str, state: RobotState) -> Sample:
    return replace(sample, robots={**sample.robots, robot: state})
