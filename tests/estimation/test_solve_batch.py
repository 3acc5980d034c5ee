"""Tests of solving many recordings of one structure in a batch."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from basecal.errors import InputError
from basecal.estimation.least_squares.bundle_adjustment import batch_states
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.problem import State
from basecal.estimation.solve import solve_from
from basecal.estimation.solve_batch import solve_batch
from basecal.numerics.batch import stack
from basecal.simulation import Scenario, simulate

SCENARIO = Scenario(samples=8, target="points")


def make_problems(scenario, count=3):
    """Problems of one structure with different pixels, the same as a batch, and the true state as start."""
    made = simulate(scenario, 1)
    problem, _ = build_problem(made.cell, made.recording)
    (group,) = problem.groups
    rng, problems = np.random.default_rng(0), []
    for _ in range(count):
        pixels = group.measurement.pixels + 0.05 * rng.standard_normal(group.measurement.pixels.shape)
        problems.append(problem.with_groups([replace(group, measurement=replace(group.measurement, pixels=pixels))]))
    together = problem.with_groups([stack([p.groups[0] for p in problems])])
    start = State(made.truth, made.cameras, np.zeros((0, 6)))
    return problems, together, start


@pytest.mark.parametrize("stated", [True, False])
def test_batch_equals_separate_solutions(stated):
    """State and covariance agree to 1e-9 of their size.

    The pixels' sigma is stated or estimated from each entry's residuals.
    """
    problems, together, start = make_problems(replace(SCENARIO, state_pixel_noise=stated))
    found = solve_batch(together, batch_states(problems[0], [start] * 3))
    assert found.converged.all()
    for row, problem in enumerate(problems):
        alone = solve_from(problem, start)
        size = np.sqrt(np.diag(alone.covariance))
        np.testing.assert_allclose(
            found.covariance[row] / np.outer(size, size),
            alone.covariance / np.outer(size, size),
            atol=1e-9 if stated else 2e-3,
        )
        for name, transform in alone.state.transforms.items():
            off = (transform.inverse() @ found.state.transforms[name][row]).log()
            np.testing.assert_allclose(off, 0.0, atol=1e-8)
        assert found.dof == alone.dof
        if stated:
            assert found.cost[row] == pytest.approx(alone.cost, rel=1e-9)


def test_stated_sigmas_are_kept():
    """With stated sigmas, the covariance is the inverse information for any residuals.

    Without, it is scaled by them.
    """
    _, together, start = make_problems(SCENARIO)
    stated = solve_batch(together, batch_states(together, [start] * 3))
    silent = solve_batch(
        make_problems(replace(SCENARIO, state_pixel_noise=False))[1], batch_states(together, [start] * 3)
    )
    ratio = silent.covariance[:, 0, 0] / stated.covariance[:, 0, 0]
    np.testing.assert_allclose(ratio, stated.cost / stated.dof, rtol=1e-6)


def test_number_of_steps_may_be_limited():
    """After one step from far off none has converged."""
    problems, together, start = make_problems(SCENARIO)
    far = {name: t @ type(t).exp(np.full(6, 0.05)) for name, t in start.transforms.items()}
    assert not solve_batch(together, batch_states(problems[0], [replace(start, transforms=far)] * 3), 1).converged.any()


def test_residuals_of_several_types_are_refused():
    """Poses without sigmas have two variances, of translations and rotations, and need separate solutions."""
    made = simulate(Scenario(samples=8, target="pose", state_observation_noise=False), 1)
    problem, _ = build_problem(made.cell, made.recording)
    start = State(made.truth, made.cameras, np.zeros((0, 6)))
    with pytest.raises(InputError, match="pose_m and pose_rad"):
        solve_batch(problem, batch_states(problem, [start] * 2))
