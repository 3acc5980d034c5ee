"""Another answer is covered along the step to it, and only there."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from basecal.accuracy.covariance.widening import largest_shift, solution_step, widen
from basecal.estimation.solve import solve
from basecal.simulation import Scenario, simulate

MADE = simulate(Scenario(samples=10), 0)
SOLUTION = solve(MADE.cell, MADE.recording)


def test_covariance_grows_by_the_square_of_the_step():
    """And not across it."""
    moved = np.zeros(SOLUTION.problem.width)
    moved[2] = 3e-3
    wider = widen(SOLUTION, moved).covariance - SOLUTION.covariance
    assert np.isclose(wider[2, 2], 9e-6)
    wider[2, 2] = 0.0
    assert not np.any(wider)


def test_the_step_between_solutions_is_that_of_their_transforms():
    """From an answer to itself none; to the answer of half the samples as far as its transforms are."""
    np.testing.assert_allclose(solution_step(SOLUTION, SOLUTION), 0.0, atol=1e-15)
    half = solve(MADE.cell, type(MADE.recording)(MADE.recording.samples[:6]))
    step = solution_step(SOLUTION, half)
    for name, where in SOLUTION.problem.columns.items():
        expected = (SOLUTION.state.transforms[name].inverse() @ half.state.transforms[name]).log()
        np.testing.assert_allclose(step[where], expected)


def test_the_step_of_a_lens_is_that_of_its_parameters():
    """In the columns of the lens; the others are those of transforms."""
    made = simulate(Scenario(samples=10, intrinsics="free"), 0)
    solution = solve(made.cell, made.recording)
    lens = solution.state.cameras["wrist"]
    off = 0.5 * np.arange(1.0, len(lens.parameters) + 1)
    moved = replace(solution.state, cameras={"wrist": lens.with_parameters(lens.parameters + off)})
    step = solution_step(solution, replace(solution, state=moved))
    where = solution.problem.columns["wrist"]
    np.testing.assert_allclose(step[where], off)
    step[where] = 0.0
    np.testing.assert_allclose(step, 0.0, atol=1e-15)


def test_the_largest_shift_is_by_the_covariance():
    """Not by its length: a millimetre along a direction that is known well is more than ten along another."""
    unit = np.zeros((2, SOLUTION.problem.width))
    unit[0, 0], unit[1, 3] = 1e-3, 1e-3
    covariance = np.diag(np.where(np.arange(SOLUTION.problem.width) == 0, 1e-4, 1e-8))
    known = replace(SOLUTION, covariance=covariance)
    np.testing.assert_array_equal(largest_shift(known, [10 * unit[0], unit[1]]), unit[1])
