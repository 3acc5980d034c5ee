"""`same-stop`."""

from dataclasses import replace

import numpy as np
import pytest

from basecal.accuracy.findings.evidence import Input
from basecal.accuracy.findings.same_stop import same_stop
from basecal.cell import Recording, RobotState
from basecal.estimation.problem.build import build_problem
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate


@pytest.mark.parametrize("jitter_m", [0.0, 2e-5])
def test_jitter_within_stops_is_told(jitter_m):
    """The robot whose read-back varies is named with how far; stops read back alike, and paths, say nothing."""
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
    assert not found or "its 3 stops" in found[0].message
    assert same_stop(Input(problem, (), on_paths=True)) == []
