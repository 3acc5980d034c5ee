"""Solve many recordings of one structure as a batch: draws of a Monte Carlo study, folds, subsets."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from basecal.errors import InputError
from basecal.estimation.least_squares.bundle_adjustment import bundle_adjust_batch
from basecal.estimation.noise.estimate import degrees_of_freedom, residual_counts
from basecal.estimation.problem.problem import Problem, State
from basecal.estimation.settings import MOST_STEPS
from basecal.geometry import Array, BoolArray


@dataclass(frozen=True, eq=False)
class SolutionBatch:
    """Maximum-likelihood states of a batch.

    Attributes:
        state: The optima, (b,).
        covariance: (b, p, p) covariances of all columns of the problem.
        cost: (b,) sums of squared residuals over sigmas.
        dof: Degrees of freedom of each entry: scalar residuals minus unknowns.
        converged: (b,) whether each state is an optimum.
    """

    state: State
    covariance: Array
    cost: Array
    dof: int
    converged: BoolArray


def solve_batch(problem: Problem, starts: State, iterations: int = MOST_STEPS) -> SolutionBatch:
    """Estimate a batch of states by maximum likelihood; each entry equals the result of `solve` for it alone.

    Args:
        problem: Problem of one structure, in which all measurements have a leading batch axis. Either all sigmas are
            stated, or there is one kind of measurement without stated sigmas. Its variance is cost / dof of each
            entry.
        starts: (b,) initial states; see `State.spread`.
        iterations: Most steps of each descent.

    Raises:
        InputError: if sigmas of several kinds are to be estimated, which needs one problem at a time.
    """
    first = problem.take_batch(np.array([0]))
    kinds = [kind for kind, count in residual_counts(first).items() if count]
    if len(kinds) > 1:
        raise InputError(f"a batch takes residuals of one kind, here are {' and '.join(kinds)}: solve them one by one")
    dof = degrees_of_freedom(first)
    ends = bundle_adjust_batch(problem, starts, dof, iterations)
    factor = np.ones(len(ends.cost)) if kinds == ["stated"] else ends.cost / max(dof, 1)
    covariance = np.linalg.inv(ends.hessian) * factor[:, None, None]
    return SolutionBatch(ends.state, covariance, ends.cost, dof, ends.converged)
