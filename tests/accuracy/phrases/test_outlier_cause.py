"""What would make outliers fit."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest

from basecal.accuracy.phrases.outlier_cause import outlier_causes
from basecal.cell import Recording, RobotState
from basecal.estimation.problem.build import build_problem
from basecal.estimation.solve import solve
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate

MADE = simulate(Scenario(samples=14, robot_noise=(1e-4, 2e-4)), 5)
SOLUTION = solve(MADE.cell, MADE.recording)


def with_poses(robot: str, pose_of: Callable[[int, SE3], SE3]) -> Recording:
    samples = MADE.recording.samples
    states = [RobotState(pose_of(k, sample.robots[robot].base_from_flange)) for k, sample in enumerate(samples)]
    slipped = (replace(s, robots={**s.robots, robot: state}) for s, state in zip(samples, states, strict=True))
    return replace(MADE.recording, samples=tuple(slipped))


def causes(recording: Recording, numbers: list[int]) -> list[str]:
    problem, _ = build_problem(MADE.cell, recording)
    state = replace(SOLUTION.state, stop_errors=0 * SOLUTION.state.stop_errors)
    return list(outlier_causes(problem, state, numbers))


def test_exchanged_rows_are_named() -> None:
    """Two rows of one robot that stand in each other's place."""
    poses = [sample.robots["hand"].base_from_flange for sample in MADE.recording.samples]
    recording = with_poses("hand", lambda k, pose: poses[{7: 8, 8: 7}.get(k, k)])
    assert causes(recording, [7, 8]) == ["The poses of hand at samples 7 and 8 are exchanged."]


@pytest.mark.parametrize(("factor", "unit"), [(1e3, "millimetres"), (1e-3, "metres among millimetres")])
def test_rows_in_another_unit_are_named(factor: float, unit: str) -> None:
    """Of two outliers in another unit both."""
    recording = with_poses("eye", lambda k, p: SE3(p.rotation, p.translation * (factor if k in (4, 11) else 1)))
    assert causes(recording, [4, 11]) == [f"Samples 4, 11 of eye look like {unit}."]


def test_a_bump_has_no_such_cause() -> None:
    """A pose that is off by itself is none of these."""
    bump = SE3.exp([0.02, 0, 0, 0, 0.02, 0])
    assert causes(with_poses("hand", lambda k, pose: pose @ bump if k in (4, 9) else pose), [4, 9]) == []
