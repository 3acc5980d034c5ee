"""Fits without some samples, and the views of these samples: what every kind of cross-validation predicts from."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from basecal.accuracy.cross_validation.folds import Samples
from basecal.estimation.least_squares.bundle_adjustment import Optimum, bundle_adjust
from basecal.estimation.noise.estimate import degrees_of_freedom
from basecal.estimation.problem.problem import Problem, State
from basecal.geometry import BoolArray


@dataclass(frozen=True, eq=False)
class Refit:
    """A fit without some samples.

    Attributes:
        held: The samples it did not use.
        used: The problem without them.
        views: The problem of them alone.
        known: (k,) which stops' errors the fit knows; those of the others stand at zero.
        optimum: The fit.
    """

    held: Samples
    used: Problem
    views: Problem
    known: BoolArray
    optimum: Optimum


def refit_folds(
    problem: Problem, state: State, folds: Iterable[Samples], iterations: int, predicted: Problem | None = None
) -> list[Refit]:
    """The fit without each fold, from the same state, stops that it does not share at their recorded poses.

    Args:
        problem: What is fitted.
        state: Where the fits start.
        folds: The samples to hold out, one set after another.
        iterations: Steps of each fit, at most.
        predicted: What is predicted, where that is more than is fitted, such as outliers.
    """
    refits = []
    for held in folds:
        used = _views(problem, held, inside=False)
        known = np.zeros(len(problem.stops) + 1, dtype=bool)
        for group in used.groups:
            known[group.eye_stop] = known[group.hand_stop] = True
        known = known[:-1]  # the last stands for views without a stop
        end = bundle_adjust(used, with_known_stops(state, known), max(degrees_of_freedom(used), 1), iterations)
        refits.append(Refit(held, used, _views(predicted or problem, held, inside=True), known, end))
    return refits


def _views(problem: Problem, samples: Samples, inside: bool) -> Problem:
    """The problem of the views of some samples, or of all others."""
    rows = [np.flatnonzero(np.isin(group.sample, list(samples)) == inside) for group in problem.groups]
    return problem.with_groups(g.take(r) for g, r in zip(problem.groups, rows, strict=True) if len(r))


def with_known_stops(state: State, known: BoolArray) -> State:
    """The state with the errors of the other stops at zero."""
    return replace(state, stop_errors=np.where(known[:, None], state.stop_errors, 0.0))
