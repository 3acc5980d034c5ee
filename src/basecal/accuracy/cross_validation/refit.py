"""Fits without some samples, and the views of these samples: what every kind of cross-validation predicts from.

All folds are fitted side by side, each with its held-out views at no weight.
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

_MOST_STEPS = 30  # of a fold, which starts at the fit to all; assumed: a fold that needs more is not converged


@dataclass(frozen=True, eq=False)
class Refit:
    """A fit without some samples.

    Attributes:
        held: The samples it did not use.
        used: The problem without them.
        views: The problem of them alone.
        known: (k,) which stops' errors the fit knows; those of the others stand at zero.
        optimum: The fit, without a batch axis.
        sparse: Its hessian, of many unknowns; else None.
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
    worth: Sequence[Array] | None = None,
) -> list[Refit]:
    """The fit without each fold, from the same state, stops that it does not share at their recorded poses.

    Views without weight count for nothing, so that each fit is that of its own problem.

    Args:
        problem: What is fitted.
        state: Where the fits start.
        folds: The samples to hold out, one set after another.
        iterations: Steps of each fit, at most.
        prediction_problem: What is predicted, where that is more than is fitted, such as outliers.
        worth: For each group (n,): what each view counts where it is used; 1 where None.
    """
    held = list(folds)
    numbers = [np.array(sorted(samples), dtype=np.int64) for samples in held]
    used = [_views(problem, each, inside=False) for each in numbers]
    known = [_known_stops(each) for each in used]
    weights = [np.stack([1.0 - np.isin(group.sample, each) for each in numbers]) for group in problem.groups]
    if worth is not None:
        weights = [used * of for used, of in zip(weights, worth, strict=True)]
    dof = np.array([max(degrees_of_freedom(each), 1) for each in used], dtype=np.float64)
    views = [_views(prediction_problem or problem, each, inside=True) for each in numbers]
    if is_sparse(problem):
        ends = [
            _sparsely(problem, with_known_stops(state, known[k]), dof[k], iterations, [w[k] for w in weights])
            for k in range(len(held))
        ]
    else:
        states = with_known_stops(state.spread(problem, len(held)), np.stack(known))
        batch = bundle_adjust_batch(problem, states, dof, iterations, weights)
        ends = [(take(batch, k), None) for k in range(len(held))]
    # Views without weight have errors of their own stops that suit them, too: what was held out.
    return [
        Refit(samples, used[k], views[k], known[k], replace(end, state=with_known_stops(end.state, known[k])), sparse)
        for k, (samples, (end, sparse)) in enumerate(zip(held, ends, strict=True))
    ]


def _sparsely(
    problem: Problem, state: State, dof: float, iterations: int, weights: Sequence[Array]
) -> tuple[OptimumBatch, SparseHessian | None]:
    """One fold's fit of many unknowns: a batch of them takes dense matrices."""
    end = bundle_adjust(problem, state, dof, iterations, weights)
    hessian = end.normal.hessian if end.sparse is None else end.sparse.matrix.toarray()
    numbers = (np.array(value) for value in (end.cost, hessian, end.converged, end.iterations))
    return OptimumBatch(end.state, *numbers), end.sparse


def _known_stops(problem: Problem) -> BoolArray:
    """Stops in which views of a problem stand, (k,)."""
    known = np.zeros(len(problem.stops) + 1, dtype=bool)
    for group in problem.groups:
        for end in group.ends:
            known[end.stop] = True
    return known[:-1]  # the last stands for views without a stop


def _views(problem: Problem, samples: IntArray, inside: bool) -> Problem:
    """The problem of the views of some samples, or of all others, in which the static scene keeps its part."""
    rows = [np.flatnonzero(np.isin(group.sample, samples) == inside) for group in problem.groups]
    views = problem.with_groups(g.take(r) for g, r in zip(problem.groups, rows, strict=True) if len(r))
    return replace(views, tied=None if inside else problem.tied)


def with_known_stops(state: State, is_known: BoolArray) -> State:
    """The state with the errors of the other stops at zero."""
    return replace(state, stop_errors=np.where(is_known[..., None], state.stop_errors, 0.0))
