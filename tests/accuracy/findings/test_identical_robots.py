"""Tests of the finding `identical-robots`: one file for two robots."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np

from basecal.accuracy.findings.evidence import Input
from basecal.accuracy.findings.identical_robots import identical_robots
from basecal.cell import Recording
from basecal.estimation.problem.build import build_problem
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate

MADE = simulate(Scenario(samples=6), 0)


def codes(recording: Recording) -> list[str]:
    return [each.code for each in identical_robots(Input(build_problem(MADE.cell, recording)[0], ()))]


def test_identical_poses_are_error() -> None:
    """Equal poses of both robots are an error; poses as recorded, and robots at rest, are not."""
    samples = MADE.recording.samples
    same = tuple(replace(s, robots=dict.fromkeys(s.robots, s.robots["eye"])) for s in samples)
    assert codes(replace(MADE.recording, samples=same)) == ["identical-robots"]
    assert codes(MADE.recording) == []
    still = tuple(replace(s, robots=dict.fromkeys(s.robots, samples[0].robots["eye"])) for s in samples)
    assert codes(replace(MADE.recording, samples=still)) == []


def poses_of(first: list[int], second: list[int], recorded: list[int], joints: bool = False) -> list[tuple[str, ...]]:
    """Robots named if two have poses of these numbers at samples of these numbers, in two groups."""

    def end(numbers: list[int]) -> SimpleNamespace:
        poses = SE3.from_rotvec(np.zeros((len(numbers), 3)), np.array(numbers, dtype=float)[:, None] * [1.0, 0.0, 0.0])
        return SimpleNamespace(base_from_flange=poses, joints=np.zeros(6) if joints else None)

    groups = [
        SimpleNamespace(
            sample=np.array(recorded[part]),
            robot_end=lambda robot, part=part: {"a": end(first[part]), "b": end(second[part])}.get(robot),
        )
        for part in (slice(0, 2), slice(2, None))
    ]
    problem = SimpleNamespace(robots=("a", "b", "c"), groups=groups)
    return [each.about for each in identical_robots(SimpleNamespace(problem=problem))]  # type: ignore[arg-type]


def test_three_shared_poses_are_beyond_chance() -> None:
    """Three different shared poses are beyond chance, two repeated ones are not.

    Poses count in sample order, and joints do not count.
    """
    assert poses_of([1, 2, 3], [1, 2, 3], [0, 1, 2]) == [("a", "b")]
    assert poses_of([1, 2, 2, 1], [1, 2, 2, 1], [0, 1, 2, 3]) == []
    assert poses_of([1, 2, 3], [3, 1, 2], [0, 1, 2]) == []
    assert poses_of([1, 2, 3], [1, 2, 4], [0, 1, 2]) == []
    assert poses_of([1, 2, 3], [1, 2, 3], [2, 0, 1]) == [("a", "b")]
    assert poses_of([1, 2, 3], [1, 2, 3], [0, 1, 2], joints=True) == []
