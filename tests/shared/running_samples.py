"""Two arms seen as points, and faults during their capture."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from basecal.cell import Cell, RobotState, Sample
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate

BASE = "eye_base_from_hand_base"


def recorded(samples: int = 10, joints: bool = False) -> tuple[Cell, list[Sample]]:
    """A cell of faultless arms that record poses or joints, and its samples; no noise is stated."""
    noise = {"robot_noise": (5e-5, 1e-4), "state_robot_noise": False}
    simulated = simulate(Scenario(samples=samples, joints=joints, **noise), 0)
    return simulated.cell, list(simulated.recording.samples)


def with_views_of(samples: Sequence[Sample], index: int, source: int) -> list[Sample]:
    """The samples, of which one has the observations of another."""
    late = replace(samples[index], observations=samples[source].observations)
    return [*samples[:index], late, *samples[index + 1 :]]


def with_hand_base_moved(samples: Sequence[Sample], shift_m: float, start: int) -> list[Sample]:
    """The samples with the base of `hand` moved along its first axis from one sample on."""
    step = SE3(np.eye(3), np.array([-shift_m, 0.0, 0.0]))
    after = [_with_state(s, "hand", RobotState(step @ s.robots["hand"].base_from_flange)) for s in samples[start:]]
    return [*samples[:start], *after]


def with_joint_off(samples: Sequence[Sample], robot: str, joint: int, rad: float) -> list[Sample]:
    """The samples with an offset on one joint."""
    offset = np.zeros(6)
    offset[joint] = rad
    return [_with_state(s, robot, RobotState(joints_rad=s.robots[robot].joints_rad + offset)) for s in samples]


def _with_state(sample: Sample, robot: str, state: RobotState) -> Sample:
    return replace(sample, robots={**sample.robots, robot: state})
