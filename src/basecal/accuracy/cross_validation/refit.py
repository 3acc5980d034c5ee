"""Fits without some samples, and the views of these samples, for all kinds of cross-validation.

All folds are fitted as one batch; held-out views have zero weight.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from basecal.accuracy.cross_validation.folds import Samples
from basecal.estimation.least_squares.bundle_adjustment import OptimumBatch, bundle_adjust, bundle_adjust_batch
from basecal.estimation.least_squares.sparse_normal_equations import is_sparse
from basecal.estimation.noise.estimate import degrees_of_freedom
from basecal.estimation.problem.problem import Problem, State
from basecal.geometry import Array, BoolArray, IntArray
from basecal.numerics.batch import take
from basecal.numerics.sparse_hessian import SparseHessian

_CONVERGED_SIGMAS = 1e-3  # of a fold: held-out errors then differ by a millionth of their expected square
_MOST_STEPS = 30  # of a fold, which starts at the fit of all samples; a fold that needs more has not converged; assumed


@dataclass(frozen=True, eq=False)
class Refit:
    """A fit without some samples.

    Attributes:
        held: Numbers of the held-out samples.
        used: The problem without the held-out samples.
        views: The problem of the held-out samples alone.
        known: (k,) whether the fit estimates the error of each stop; the errors of other stops are zero.
        optimum: The fit, without a batch axis.
        sparse: The sparse Hessian if the problem has many unknowns; else None.
    """

    held: Samples
    used: Problem
    views: Problem
    known: BoolArray
    optimum: OptimumBatch
    sparse: SparseHessian | None = None


def refit_folds(
    problem: Problem,
    state: State,
    folds: Iterable[Samples],
    iterations: int = _MOST_STEPS,
    prediction_problem: Problem | None = None,
    view_weights: Sequence[Array] | None = None,
) -> list[Refit]:
    """Fit the problem without each fold, all from the same state.

    Stops of held-out samples alone keep their recorded poses. Views of zero weight have no influence, so each fit is
    that of its own problem.

    Args:
        problem: The problem to fit.
        state: Initial state of the fits.
        folds: Sets of samples to hold out, one set for each fit.
        iterations: Largest number of steps of each fit.
        prediction_problem: The problem of the views to predict, if it has more views, such as outliers.
        view_weights: (n,) weights of the used views of each group; 1 if None.
    """
    held = list(folds)
    numbers = [np.array(sorted(samples), dtype=np.int64) for samples in held]
    used = [_select_views(problem, each, inside=False) for each in numbers]
    known = [_known_stops(each) for each in used]
    weights = [np.stack([1.0 - np.isin(group.sample, each) for each in numbers]) for group in problem.groups]
    if view_weights is not None:
        weights = [mask * own for mask, own in zip(weights, view_weights, strict=True)]
    dof = np.array([max(degrees_of_freedom(each), 1) for each in used], dtype=np.float64)
    views = [_select_views(prediction_problem or problem, each, inside=True) for each in numbers]
    if is_sparse(problem):
        ends = [
            _refit_sparse(problem, with_known_stops(state, known[k]), dof[k], iterations, [w[k] for w in weights])
            for k in range(len(held))
        ]
    else:
        states = with_known_stops(state.repeat(problem, len(held)), np.stack(known))
        batch = bundle_adjust_batch(problem, states, dof, iterations, weights, _CONVERGED_SIGMAS)
        ends = [(take(batch, k), None) for k in range(len(held))]
    # The errors of stops of held-out views alone were fitted to these views at zero weight: reset them.
    return [
        Refit(samples, used[k], views[k], known[k], replace(end, state=with_known_stops(end.state, known[k])), sparse)
        for k, (samples, (end, sparse)) in enumerate(zip(held, ends, strict=True))
    ]


def _refit_sparse(
    problem: Problem, state: State, dof: float, iterations: int, weights: Sequence[Array]
) -> tuple[OptimumBatch, SparseHessian | None]:
    """Fit one fold of a problem with many unknowns; a batch would need dense matrices."""
    end = bundle_adjust(problem, state, dof, iterations, weights, tolerance=_CONVERGED_SIGMAS)
    hessian = end.normal.hessian if end.sparse is None else end.sparse.matrix.toarray()
    numbers = (np.array(value) for value in (end.cost, hessian, end.converged, end.iterations))
    return OptimumBatch(end.state, *numbers), end.sparse


def _known_stops(problem: Problem) -> BoolArray:
    """Mask of the stops that views of a problem use, (k,)."""
    known = np.zeros(len(problem.stops) + 1, dtype=bool)
    for group in problem.groups:
        for end in group.ends:
            known[end.stop] = True
    return known[:-1]  # the last entry is for views without a stop


def _select_views(problem: Problem, samples: IntArray, inside: bool) -> Problem:
    """Problem of the views of some samples, or of all other views; only the latter keeps the static scene."""
    rows = [np.flatnonzero(np.isin(group.sample, samples) == inside) for group in problem.groups]
    return replace(problem.take_views(rows), tied=None if inside else problem.tied)


def with_known_stops(state: State, is_known: BoolArray) -> State:
    """Return the state with the errors of unknown stops set to zero."""
    return replace(state, stop_errors=np.where(is_known[..., None], state.stop_errors, 0.0))
