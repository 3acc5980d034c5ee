"""One file for two robots."""

from __future__ import annotations

from dataclasses import replace

from basecal.accuracy.findings.evidence import Input
from basecal.accuracy.findings.identical_robots import identical_robots
from basecal.cell import Recording
from basecal.estimation.problem.build import build_problem
from basecal.simulation import Scenario, simulate

MADE = simulate(Scenario(samples=6), 0)


def codes(recording: Recording) -> list[str]:
    return [each.code for each in identical_robots(Input(build_problem(MADE.cell, recording)[0], ()))]


def test_identical_poses_are_an_error() -> None:
    """Both robots have the poses of one; recorded as they were, and still, they are no error."""
    samples = MADE.recording.samples
    same = tuple(replace(s, robots=dict.fromkeys(s.robots, s.robots["eye"])) for s in samples)
    assert codes(replace(MADE.recording, samples=same)) == ["identical-robots"]
    assert codes(MADE.recording) == []
    still = tuple(replace(s, robots=dict.fromkeys(s.robots, samples[0].robots["eye"])) for s in samples)
    assert codes(replace(MADE.recording, samples=still)) == []
