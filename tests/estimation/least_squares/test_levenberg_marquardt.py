"""Properties of every descent."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from basecal.estimation.least_squares.levenberg_marquardt import levenberg_marquardt
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
def test_no_step_raises_the_cost(scenario, off):
    """Stopped after any number of steps, the cost at hand is not above that of fewer."""
    problem, start = problem_and_start(replace(scenario, samples=8), off)
    costs = [linearise(problem, start).cost] + [
        levenberg_marquardt(problem, start, 1, k).normal.cost for k in range(1, 12)
    ]
    assert np.all(np.diff(costs) <= 1e-9 * costs[0])
    assert costs[-1] < 0.5 * costs[0]


def test_the_end_is_an_optimum():
    """No gradient is left: one more step would be below 1e-5 sigma."""
    problem, start = problem_and_start(Scenario(samples=12, target="points"), 0.02)
    end = levenberg_marquardt(problem, start, 100)
    assert end.converged
    at_end = linearise(problem, end.state)
    step = np.linalg.solve(at_end.hessian, at_end.gradient)
    assert np.sqrt(step @ at_end.gradient) < 1e-5
    assert at_end.cost == pytest.approx(end.normal.cost, rel=1e-9)


@pytest.mark.parametrize("seed", [1, 3])
def test_the_end_does_not_depend_on_errors_of_stops_at_the_start(seed):
    """From its own end, the stops' errors forgotten: the same cost, though hardly anything else moves at first."""
    noise = (2e-3, 0.03)
    scenario = Scenario(layout="eye_to_hand", target="pose", spread_rad=0.6, pose_noise=noise, robot_noise=noise)
    problem, start = problem_and_start(scenario, 1e-3, seed)
    end = levenberg_marquardt(problem, start, 100)
    again = levenberg_marquardt(problem, replace(end.state, stop_errors=np.zeros_like(end.state.stop_errors)), 100)
    assert again.normal.cost == pytest.approx(end.normal.cost, rel=1e-8)


def test_information_without_rank_is_no_error():
    """Both arms still: most directions are not seen, and the descent still ends, with finite transforms."""
    problem, start = problem_and_start(Scenario(samples=6, arms="eye_still", target="points"), 1e-3)
    problem = problem.with_groups(g.take(np.zeros(4, dtype=np.int64)) for g in problem.groups)
    assert np.linalg.matrix_rank(linearise(problem, start).hessian) < problem.width
    end = levenberg_marquardt(problem, start, 1)
    assert np.isfinite(end.normal.cost)
    assert all(np.isfinite(t.matrix).all() for t in end.state.transforms.values())


def test_a_step_moves_each_unknown_on_its_right():
    """A point's mount by its three columns, and what has no columns not at all."""
    problem, start = problem_and_start(Scenario(samples=6, target="led", camera_mount="fixed"), 1e-3)
    step = 0.1 * np.random.default_rng(0).standard_normal(problem.width)
    after = retract(problem, start, linearise(problem, start), step)
    for name, before in start.transforms.items():
        xi = np.zeros(6)
        where = problem.columns.get(name, slice(0, 0))
        xi[: where.stop - where.start] = step[where]
        np.testing.assert_allclose((before.inverse() @ after.transforms[name]).log(), xi, atol=1e-12)
