"""Tests of the maximum-likelihood solver on batches of draws."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from basecal.errors import InputError
from basecal.estimation.solve import solve_problem
from basecal.estimation.solve_batch import SolutionBatch
from basecal.studies.draws import Draws, draw, draw_cell, group_pixels
from basecal.studies.solvers import maximum_likelihood
from basecal.studies.solvers.maximum_likelihood import solve
from study_example import SMALL, study


@cache
def make_draws(hold: str, count: int = 4) -> Draws:
    settings = study(hold=f"{SMALL}, {hold}").points[0].settings
    return draw(draw_cell(settings, 2, 0, None), settings, (2, 0, 0), count)


@pytest.mark.journey
@pytest.mark.parametrize(
    "hold",
    ["pixel_px: 0.2", "state_pixel_noise: false", "robot_sigma_t_m: 2e-4, robot_sigma_r_rad: 2e-4, arms: stations"],
)
def test_batch_matches_individual_solutions(hold: str) -> None:
    """Transform and covariance of each trial are those of `solve` without a guess, to a thousandth of a sigma."""
    draws = make_draws(hold)
    found = solve(draws)
    group = draws.problem.groups[0]
    for trial in range(draws.count):
        pixels = group_pixels(group).pixels[trial]
        alone = draws.problem.with_groups([replace(group, measurement=replace(group_pixels(group), pixels=pixels))])
        own = solve_problem(alone, draws.simulated.cell).transforms[draws.transform]
        apart = (own.mean.inverse() @ found.transform[trial]).log()
        assert np.abs(apart / np.sqrt(np.diag(own.covariance))).max() < 1e-3
        np.testing.assert_allclose(found.covariance[trial], own.covariance, rtol=1e-2, atol=1e-5 * own.covariance.max())


def test_own_starts_solve_trials_independently(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each trial is solved without a guess, and has the solution of the batch."""
    together = solve(make_draws("pixel_px: 0.2", 2))
    monkeypatch.delattr(maximum_likelihood, "solve_batch")
    alone = solve(make_draws("pixel_px: 0.2, own_starts: true", 2))
    assert alone.solved.all()
    np.testing.assert_allclose(alone.transform.matrix, together.transform.matrix, atol=1e-7)


def test_trial_in_local_minimum_is_solved_again(monkeypatch: pytest.MonkeyPatch) -> None:
    """A trial with a large cost in the batch, or without convergence, gets its individual solution."""
    draws = make_draws("pixel_px: 0.2", 5)
    right, batch = solve(draws), maximum_likelihood.solve_batch

    def astray(problem, starts) -> SolutionBatch:
        """Batch with wrong results for its first two entries."""
        found = batch(problem, starts)
        cost, converged = found.cost.copy(), found.converged.copy()
        cost[0], converged[1] = 1e9, False
        found.state.transforms[draws.transform].translation.setflags(write=True)
        found.state.transforms[draws.transform].translation[:2] += 1.0
        return replace(found, cost=cost, converged=converged)

    monkeypatch.setattr(maximum_likelihood, "solve_batch", astray)
    found = solve(draws)
    assert found.solved.all()
    np.testing.assert_allclose(found.transform.matrix, right.transform.matrix, atol=1e-8)


def test_unobservable_trials_have_no_answer() -> None:
    """Two samples leave the base undetermined."""
    settings = study(hold=SMALL.replace("samples: 8", "samples: 2")).points[0].settings
    found = solve(draw(draw_cell(settings, 0, 0, None), settings, (0, 0, 0), 3))
    assert not found.solved.any()
    assert found.reason


def test_trial_that_fails_again_has_no_answer(monkeypatch: pytest.MonkeyPatch) -> None:
    """The trial has no answer although the batch converged for it.

    The others keep their answers, and the reason is given.
    """
    draws = make_draws("pixel_px: 0.2")
    batch, alone = maximum_likelihood.solve_batch, maximum_likelihood._solve_trial

    def far(problem, starts) -> SolutionBatch:
        """Batch with a large cost for its third entry."""
        found = batch(problem, starts)
        return replace(found, cost=np.where(np.arange(4) == 2, 1e9, found.cost))

    def only_first(draws, trial):
        if trial:
            raise InputError("no solution")
        return alone(draws, trial)

    monkeypatch.setattr(maximum_likelihood, "_solve_trial", only_first)
    whole = solve(draws)
    assert (whole.solved.all(), whole.reason) == (True, "")
    monkeypatch.setattr(maximum_likelihood, "solve_batch", far)
    found = solve(draws)
    assert found.solved.tolist() == [True, True, False, True]
    assert found.reason == "not converged"
    np.testing.assert_array_equal(found.transform.matrix, whole.transform.matrix)


def test_trials_are_solved_again_above_four_sigmas(monkeypatch: pytest.MonkeyPatch) -> None:
    """The limit is that of the root of the cost, relative to the median of the trials."""
    draws, solved_again = make_draws("pixel_px: 0.2"), []
    first = maximum_likelihood._solve_trial(draws, 0)
    batch = maximum_likelihood.solve_batch(draws.problem, first.state.repeat(draws.problem, 4))
    monkeypatch.setattr(maximum_likelihood, "_solve_trial", lambda of, k: solved_again.append(k) or first)
    for above in (15.9, 16.1):
        found = replace(batch, cost=np.array([1.0, above, 1.0, 0.5]))
        monkeypatch.setattr(maximum_likelihood, "solve_batch", lambda *_, found=found: found)
        assert solve(draws).solved.all()
    assert solved_again == [0, 0, 1]


def test_mount_is_solved_for_each_trial() -> None:
    """The columns of the mount follow those of the base; the covariance is that of its six directions."""
    settings = study(hold=f"{SMALL}, pixel_px: 0.2, own_starts: true").points[0].settings
    cell = draw_cell(settings, 2, 0, "hand_flange_from_board")
    found = solve(draw(cell, settings, (2, 0, 0), 1))
    assert cell.problem.columns[cell.transform].start > 0
    assert found.covariance is not None
    assert found.covariance.shape == (1, 6, 6)
    assert found.solved.all()
