"""Tests of `ArmErrors`: error models of robots, computed once."""

from __future__ import annotations

from dataclasses import replace

import pytest

from basecal.accuracy.task.arm_errors import ArmErrors
from basecal.estimation.settings import Settings
from basecal.estimation.solve import solve
from basecal.simulation import Scenario, simulate

POSES = Scenario(samples=8, robot_noise=(1e-4, 2e-4), state_robot_noise=False)
JOINTS = replace(POSES, joints=True)


@pytest.fixture(scope="module", params=[POSES, JOINTS], ids=["poses", "joints"])
def solved(request):
    """A cell whose arms state no noise, and its solution."""
    made = simulate(request.param, 1)
    return request.param, made, solve(made.cell, made.recording, Settings(robot_noise="estimated"))


def test_models_match_recorded_states(solved):
    """Robots with joints have joint and link models; robots with poses have models without and with shared errors."""
    scenario, made, solution = solved
    arms = ArmErrors(made.cell, solution, solution)
    assert [kinds for kinds, _ in arms.joint_models] == (
        [("joint_offsets",), ("link_parameters",), ("joint_offsets", "link_parameters")] if scenario.joints else []
    )
    assert "" in solution.noise.models
    assert ("smooth_by_reach" in solution.noise.models) != scenario.joints


def test_models_are_computed_once(solved, monkeypatch):
    """Models are computed once however often they are requested, and so are the nodes of their sigmas."""
    _, made, solution = solved
    arms = ArmErrors(made.cell, solution, solution)
    first = arms.joint_models, arms.sizes, solution.noise.models[""].nodes
    for name in ("model_sigmas", "known_sizes"):
        monkeypatch.setattr(f"basecal.accuracy.task.arm_errors.{name}", None)
    again = arms.joint_models, arms.sizes, solution.noise.models[""].nodes
    assert all(a is b for a, b in zip(first, again, strict=True))


def test_stated_noise_leaves_no_models():
    """With stated noise there are no models; only fields and sizes remain."""
    made = simulate(replace(POSES, state_robot_noise=True), 1)
    solution = solve(made.cell, made.recording)
    assert (ArmErrors(made.cell, solution, solution).joint_models, solution.noise.models) == ([], {})
