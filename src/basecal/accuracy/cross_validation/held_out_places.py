"""Errors at held-out places of touches, predicted from the other places."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from basecal.accuracy.cross_validation.folds import place_split
from basecal.accuracy.cross_validation.refit import Refit, refit_folds
from basecal.accuracy.cross_validation.station_scores import held_out_columns, place_unknowns, predict_views
from basecal.estimation.least_squares.normal_equations import linearise
from basecal.estimation.least_squares.sparse_normal_equations import is_sparse
from basecal.estimation.problem.problem import State
from basecal.estimation.solve import Solution
from basecal.geometry import Array
from basecal.numerics.spectral import VIEW_ROUNDING, spectrum

_OPEN_SIGMA = 1.0  # [m, rad] of what the other places leave open: as wide as an arm reaches, or 57 deg; assumed


class PlaceError(NamedTuple):
    """A mark whose place was held out.

    Attributes:
        mark: Its name.
        error_m: Rms distance of its touches from where the answer of the other places has them [m].
        ratio: Root of the mean square of that over what noise, and doubt about the answer, explain.
        freedoms: Of the mean.
    """

    mark: str
    error_m: float
    ratio: float
    freedoms: float


def place_errors(solution: Solution, iterations: int) -> tuple[PlaceError, ...]:
    """Errors at each mark, held out with all that stays together with it; none if touches are not of three places.

    Args:
        solution: The answer, with the noise in use.
        iterations: Steps of each fit, at most.
    """
    problem = solution.noise.hold_sigmas(solution.problem)
    split = place_split(problem)
    if split is None or is_sparse(problem) or not solution.converged:
        return ()
    fresh = replace(solution.state, stop_errors=np.zeros_like(solution.state.stop_errors))
    sums: dict[str, Array] = {}
    for fit in refit_folds(problem, fresh, split.folds, iterations):
        end = place_unknowns(fit)
        for group, expected in zip(fit.views.groups, _expected_squares(fit, end), strict=True):
            views = predict_views(problem, group, end)
            numbers = [views.far.sum(), expected, views.freedoms.sum(), np.sum(views.off_m**2), len(group)]
            sums[group.target] = sums.get(group.target, np.zeros(5)) + numbers
    return tuple(
        PlaceError(mark, float(np.sqrt(square_m2 / count)), float(np.sqrt(far / expected)), float(freedoms))
        for mark, (far, expected, freedoms, square_m2, count) in sums.items()
        if np.isfinite(far) and np.isfinite(square_m2)
    )


def _expected_squares(fit: Refit, state: State) -> list[float]:
    """Squares that are expected of the held-out views of each group: by noise, and by doubt about the answer.

    What the views alone depend on has taken its share of both: their residuals are orthogonal to it.
    """
    place = held_out_columns(fit)
    known = np.setdiff1d(np.arange(fit.used.width), place)
    covariance = np.linalg.inv(fit.optimum.hessian[np.ix_(known, known)] + np.eye(len(known)) / _OPEN_SIGMA**2)
    rows = []
    for of in linearise(fit.views, state).views:
        root = spectrum(of.information, VIEW_ROUNDING).root
        by_views = np.zeros((len(root) * root.shape[-1], fit.used.width))
        by_views[:, of.columns] = (root.mT @ of.by_unknowns).reshape(len(by_views), -1)
        rows.append(by_views)
    every = np.concatenate(rows)
    by_place = every[:, place]
    left = np.eye(len(every)) - by_place @ spectrum(by_place.T @ by_place).inverse @ by_place.T
    doubt = left @ every[:, known]
    squares = np.diag(left) * every.any(axis=1) + np.einsum("ij,jk,ik->i", doubt, covariance, doubt)
    ends = np.cumsum([0, *map(len, rows)])
    return [float(squares[start:stop].sum()) for start, stop in pairwise(ends)]
