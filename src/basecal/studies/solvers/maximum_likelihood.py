"""The solver of basecal: the first trial without a guess, the others as one batch started at its solution.

A trial that does not converge from there, or whose residuals are too large for noise, is solved alone without a guess.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from basecal.errors import BasecalError
from basecal.estimation.solve import Solution, solve_problem
from basecal.estimation.solve_batch import solve_batch
from basecal.geometry import SE3, BoolArray
from basecal.studies.draws import Draws, group_pixels
from basecal.studies.solvers.solver import Answers, Solver, no_answers

_PLAUSIBLE_SIGMAS = 4.0  # root of a trial's cost relative to the median: larger at another optimum, not by noise


def solve(draws: Draws) -> Answers:
    """Solve all trials."""
    if draws.own_starts:
        return _solve_trials(draws)
    try:
        first = _solve_trial(draws, 0)
    except (BasecalError, np.linalg.LinAlgError) as error:
        return no_answers(draws.count, str(error))
    if draws.transform in first.observability.unobservable:
        return no_answers(draws.count, f"{draws.transform} is not observable")
    if first.observability.unobservable:  # the batch inverts the whole information matrix
        return _solve_trials(draws)
    try:
        found = solve_batch(draws.problem, first.state.repeat(draws.problem, draws.count))
    except np.linalg.LinAlgError:  # the information matrix of one trial is singular
        return _solve_trials(draws)
    where = draws.problem.columns[draws.transform]
    together = Answers(found.state.transforms[draws.transform], found.covariance[:, where, where], found.converged)
    return _complete_answers(
        draws, together, ~found.converged | (found.cost > _PLAUSIBLE_SIGMAS**2 * np.median(found.cost))
    )


def _solve_trials(draws: Draws) -> Answers:
    """Solve all trials separately."""
    where = draws.problem.columns[draws.transform]
    width = where.stop - where.start
    nothing = no_answers(draws.count, "")
    nothing = replace(nothing, covariance=np.zeros((draws.count, width, width)))
    return _complete_answers(draws, nothing, np.ones(draws.count, dtype=bool))


def _complete_answers(draws: Draws, solution: Answers, again: BoolArray) -> Answers:
    """The answers of a batch, with the trials in the mask `again`, (b,), solved separately."""
    rotation, translation = solution.transform.rotation.copy(), solution.transform.translation.copy()
    assert solution.covariance is not None
    covariance, solved = solution.covariance.copy(), solution.solved.copy()
    where = draws.problem.columns[draws.transform]
    for trial in np.flatnonzero(again):
        try:
            own = _solve_trial(draws, int(trial))
        except (BasecalError, np.linalg.LinAlgError):
            solved[trial] = False
            continue
        transform = own.state.transforms[draws.transform]
        rotation[trial], translation[trial] = transform.rotation, transform.translation
        covariance[trial] = own.covariance[where, where]
        solved[trial] = own.converged and draws.transform not in own.observability.unobservable
    return Answers(SE3(rotation, translation), covariance, solved, "" if solved.all() else "not converged")


def _solve_trial(draws: Draws, trial: int) -> Solution:
    """Solve one trial without a guess."""
    groups = [
        replace(group, measurement=replace(group_pixels(group), pixels=group_pixels(group).pixels[trial]))
        for group in draws.problem.groups
    ]
    return solve_problem(draws.problem.with_groups(groups), draws.simulated.cell)


SOLVER = Solver(solve)
