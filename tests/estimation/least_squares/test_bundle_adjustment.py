"""Tests of properties of bundle adjustment."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.pose_problem import pose_problem

from basecal.estimation.least_squares.bundle_adjustment import (
    ROUGH_SIGMAS,
    _Bundle,
    batch_states,
    bundle_adjust,
    bundle_adjust_batch,
)
from basecal.estimation.least_squares.normal_equations import linearise, retract
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.problem import Problem, State
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate


def problem_and_start(scenario: Scenario, off: float, seed: int = 3) -> tuple[Problem, State]:
    made = simulate(scenario, seed)
    problem, _ = build_problem(made.cell, made.recording)
    rng = np.random.default_rng(seed)
    near = {name: made.truth[name] @ SE3.exp(off * rng.standard_normal(6)) for name in problem.unknowns}
    return problem, State(near, made.cameras, np.zeros((len(problem.stops), 6)))


@pytest.mark.parametrize("off", [0.02, 0.2])
@pytest.mark.parametrize(
    "scenario",
    [Scenario(target="points"), Scenario(target="pose"), Scenario(target="points", robot_noise=(3e-4, 5e-4))],
    ids=str,
)
def test_cost_never_increases(scenario, off):
    """The cost after any number of steps is at most the cost after fewer steps."""
    problem, start = problem_and_start(replace(scenario, samples=8), off)
    costs = [linearise(problem, start).cost] + [bundle_adjust(problem, start, 1, k).cost for k in range(1, 12)]
    assert np.all(np.diff(costs) <= 1e-9 * costs[0])
    assert costs[-1] < 0.5 * costs[0]


def test_descent_ends_at_an_optimum():
    """At the end the gradient is negligible: one more step is below 1e-5 sigma."""
    problem, start = problem_and_start(Scenario(samples=12, target="points"), 0.02)
    end = bundle_adjust(problem, start, 100)
    assert end.converged
    at_end = linearise(problem, end.state)
    step = np.linalg.solve(at_end.hessian, at_end.gradient)
    assert np.sqrt(step @ at_end.gradient) < 1e-5
    assert at_end.cost == pytest.approx(end.cost, rel=1e-9)


@pytest.mark.parametrize("seed", [1, 3])
def test_optimum_is_independent_of_initial_stop_errors(seed):
    """From the optimum with stop errors reset, the cost is the same, though hardly anything else moves at first."""
    noise = (2e-3, 0.03)
    scenario = Scenario(layout="eye_to_hand", target="pose", spread_rad=0.6, pose_noise=noise, robot_noise=noise)
    problem, start = problem_and_start(scenario, 1e-3, seed)
    end = bundle_adjust(problem, start, 100)
    again = bundle_adjust(problem, replace(end.state, stop_errors=np.zeros_like(end.state.stop_errors)), 100)
    assert again.cost == pytest.approx(end.cost, rel=1e-8)


@pytest.mark.parametrize("seed", [1, 3])
def test_rough_tolerance_ends_sooner_and_near(seed):
    """After fewer steps the state is within the tolerance of the optimum, in its sigmas. Stop errors are large here."""
    noise = (2e-3, 0.03)
    scenario = Scenario(layout="eye_to_hand", target="pose", spread_rad=0.6, pose_noise=noise, robot_noise=noise)
    problem, start = problem_and_start(scenario, 0.02, seed)
    end = bundle_adjust(problem, start, 100)
    rough = bundle_adjust(problem, start, 100, tolerance=ROUGH_SIGMAS)
    assert rough.converged
    assert rough.iterations < end.iterations
    assert np.sqrt(linearise(problem, rough.state).cost - end.cost) < ROUGH_SIGMAS * np.sqrt(end.cost / 100)


def test_information_without_rank_is_no_error():
    """With both arms still, most directions are unobservable, and the descent ends with finite transforms."""
    problem, start = problem_and_start(Scenario(samples=6, arms="eye_still", target="points"), 1e-3)
    problem = problem.with_groups(g.take(np.zeros(4, dtype=np.int64)) for g in problem.groups)
    assert np.linalg.matrix_rank(linearise(problem, start).hessian) < problem.width
    end = bundle_adjust(problem, start, 1)
    assert np.isfinite(end.cost)
    assert all(np.isfinite(t.matrix).all() for t in end.state.transforms.values())


def test_step_moves_each_unknown_on_its_right():
    """A point's mount moves by its three columns, and transforms without columns do not move."""
    problem, start = problem_and_start(Scenario(samples=6, target="led", camera_mount="fixed"), 1e-3)
    step = 0.1 * np.random.default_rng(0).standard_normal(problem.width)
    after = retract(problem, start, linearise(problem, start), step)
    for name, before in start.transforms.items():
        xi = np.zeros(6)
        where = problem.columns.get(name, slice(0, 0))
        xi[: where.stop - where.start] = step[where]
        np.testing.assert_allclose((before.inverse() @ after.transforms[name]).log(), xi, atol=1e-12)


SCENARIOS = [
    Scenario(target="points", samples=8),
    Scenario(target="pose", samples=8),
    Scenario(target="points3d", samples=8),
    Scenario(target="points", samples=8, robot_noise=(3e-4, 5e-4)),
    Scenario(target="points", samples=12, arms="stations", stations=4, robot_noise=(3e-4, 5e-4)),
    Scenario(target="points", samples=8, intrinsics="free"),
]


@pytest.mark.parametrize("scenario", SCENARIOS, ids=str)
def test_batch_equals_separate_states(scenario):
    """Three starts in a batch end where each ends alone, to 1e-9 of cost and of transforms."""
    problem, _ = problem_and_start(scenario, 0.0)
    starts = [problem_and_start(scenario, off)[1] for off in (0.01, 0.03, 0.05)]
    together = bundle_adjust_batch(problem, batch_states(problem, starts), 100)
    for row, start in enumerate(starts):
        alone = bundle_adjust(problem, start, 100)
        assert together.cost[row] == pytest.approx(alone.cost, rel=1e-9)
        assert together.iterations[row] == alone.iterations
        for name, transform in alone.state.transforms.items():
            np.testing.assert_allclose(together.state.transforms[name].matrix[row], transform.matrix, atol=1e-9)


def test_batch_entries_have_own_views_and_weights():
    """Entries with other views, and entries with zero weights, end where a problem of those views ends."""
    problem, start = problem_and_start(Scenario(target="points", samples=9), 0.02)
    subsets = np.array([[0, 1, 2, 3, 4, 5], [3, 4, 5, 6, 7, 8]])
    states = batch_states(problem, [start, start])
    gathered = problem.with_groups(g.take(subsets) for g in problem.groups)
    weights = np.zeros((2, 9))
    np.put_along_axis(weights, subsets, 1.0, axis=1)
    by_views = bundle_adjust_batch(gathered, states, 100)
    by_weights = bundle_adjust_batch(problem, states, 100, weights=[weights])
    for row, views in enumerate(subsets):
        alone = bundle_adjust(problem.with_groups(g.take(views) for g in problem.groups), start, 100)
        for ends in (by_views, by_weights):
            assert ends.cost[row] == pytest.approx(alone.cost, rel=1e-9)
            for name, transform in alone.state.transforms.items():
                np.testing.assert_allclose(ends.state.transforms[name].matrix[row], transform.matrix, atol=1e-9)


def test_weights_of_a_batch_are_indexed_if_separate():
    """Weights shared by all entries are unchanged."""
    problem, _ = pose_problem(np.zeros((3, 6)), np.ones(6))
    own = np.arange(6.0).reshape(2, 3)
    shared, taken = _Bundle(problem, [np.arange(3.0), own]).take(np.array([1])).weights
    np.testing.assert_array_equal(shared, [0, 1, 2])
    np.testing.assert_array_equal(taken, own[[1]])
    assert _Bundle(problem, None).take(np.array([1])).weights is None
