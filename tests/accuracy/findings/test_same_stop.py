"""Tests of the finding `same-stop`."""

from dataclasses import replace

import numpy as np
import pytest
from tests.ends import end, problem_of, views

from basecal.accuracy.findings.evidence import Input
from basecal.accuracy.findings.same_stop import same_stop
from basecal.cell import Recording, RobotState
from basecal.estimation.problem.build import build_problem
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate


@pytest.mark.parametrize("jitter_m", [0.0, 2e-5])
def test_jitter_within_stops_is_reported(jitter_m):
    """A robot whose read-back varies within stops is named with the distance.

    Equal read-backs and paths give no finding.
    """
    made = simulate(Scenario(samples=12, target="led", arms="stations", stations=3), 0)
    rng = np.random.default_rng(0)
    samples = []
    for sample in made.recording.samples:
        pose = sample.robots["eye"].base_from_flange
        read = SE3(pose.rotation, pose.translation + jitter_m * rng.uniform(-1, 1, 3))
        samples.append(replace(sample, robots={**sample.robots, "eye": RobotState(read)}))
    problem, _ = build_problem(made.cell, Recording(tuple(samples)))
    found = same_stop(Input(problem, ()))
    assert [(f.code, f.severity, f.about) for f in found] == ([("same-stop", "info", ("eye",))] if jitter_m else [])
    assert not found or "at 3 stops" in found[0].message
    assert same_stop(Input(problem, (), on_paths=True)) == []


def stops_of(*moves, stands):
    """Findings about a robot that carries a target, at these stops, with poses off by these tangents.

    The first pose is in a group of the camera's own.
    """
    recorded = SE3.exp(np.array(moves, dtype=float))
    first = views(end("arm", recorded[:1], stop_number=stands[:1]), end())
    others = views(end(), end("arm", recorded[1:], stop_number=stands[1:]))
    return same_stop(Input(problem_of(first, others), ()))


PLACE = [0.5, 0.2, 0.1, 0.0, 0.0, 0.0]


@pytest.mark.parametrize(("off", "size"), [
    ([3e-5, 4e-5, 0, 0, 0, 0], "0.050 mm and 0 mrad"),
    ([0, 0, 0, 0, 6e-4, -8e-4], "0 mm and 1.0 mrad"),
    ([9e-10, 0, 0, 0, 0, 0], None),
    ([0, 0, 0, 0, 0, 9e-10], None),
    ([1.1e-9, 0, 0, 0, 0, 0], "0.000001 mm and 0 mrad"),
])  # fmt: skip
def test_largest_difference_within_stop_is_reported(off, size):
    """The largest translation and rotation from the first pose of a stop are reported, in any group.

    Other stops do not count, nor does rounding.
    """
    found = stops_of(np.zeros(6), PLACE, off, stands=[4, 7, 4])
    assert [f.about for f in found] == ([] if size is None else [("arm",)])
    assert size is None or f"Poses within one stop of arm differ by up to {size}, at 2 stops." in found[0].message
