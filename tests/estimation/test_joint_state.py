"""Tests of several pairs that jointly determine a state that none determines alone."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from basecal.cell import Unknown
from basecal.estimation import joint_state as module
from basecal.estimation.joint_state import joint_state
from basecal.estimation.problem.build import build_problem
from basecal.estimation.solve import solve
from basecal.simulation import Scenario, SimulatedCell, simulate


def ring(seed: int) -> SimulatedCell:
    """Three arms with six pairs, each with two or three views."""
    return simulate(Scenario(layout="ring", robots=3, samples=16, robot_noise=(1e-4, 2e-4)), seed)


@pytest.mark.journey
@pytest.mark.parametrize("seed", [0, 1, 2, 3, 5])  # 4 is solved below
def test_ring_of_few_views_starts_near_the_truth(seed: int) -> None:
    """All transforms of the joint start are within 5 deg."""
    made = ring(seed)
    problem, _ = build_problem(made.cell, made.recording)
    state = joint_state(problem, made.cell)
    assert state is not None
    off = [(made.truth[name].inverse() @ state.transforms[name]).log()[3:] for name in problem.unknowns]
    assert np.degrees(np.abs(off).max()) < 5


@pytest.mark.parametrize(("robots", "starts"), [(12, 100), (20, 39)])
def test_starts_of_many_arms_are_fewer(robots, starts, monkeypatch) -> None:
    """The Hessians of all starts take at most 40 MB."""
    made = simulate(Scenario(layout="ring", robots=robots, samples=2 * robots, target="pose"), 0)
    problem, _ = build_problem(made.cell, made.recording)
    counts = []

    def first_start(_, states, **options):
        counts.extend({len(pose) for pose in states.transforms.values()})
        return SimpleNamespace(best_state=states)

    monkeypatch.setattr(module, "bundle_adjust_batch", first_start)
    module.joint_state(problem, made.cell)
    assert counts == [starts]


@pytest.mark.journey
def test_known_base_is_unchanged() -> None:
    """The other transforms are found beside a stated base."""
    made = ring(0)
    name = made.cell.base_name(list(made.cell.robots)[1])
    cell = made.cell.with_transform(name, Unknown("fixed", made.truth[name]))
    problem, _ = build_problem(cell, made.recording)
    state = joint_state(problem, cell)
    assert state is not None
    np.testing.assert_array_equal(state.transforms[name].matrix, made.truth[name].matrix)
    off = [(made.truth[each].inverse() @ state.transforms[each]).log()[3:] for each in problem.unknowns]
    assert np.degrees(np.abs(off).max()) < 5


@pytest.mark.journey
def test_ring_of_few_views_is_solved() -> None:
    """The plain starts of this ring end 51 px off, and the solution explains the views."""
    made = ring(4)
    found = solve(made.cell, made.recording)
    assert found.converged
    assert found.cost < 2 * found.dof


def test_single_pair_has_no_joint_state() -> None:
    """A single pair has no joint state, nor has an LED."""
    for scenario in (Scenario(), Scenario(target="led")):
        made = simulate(scenario, 1)
        assert joint_state(build_problem(made.cell, made.recording)[0], made.cell) is None
