"""How well a problem predicts stations, or places of touches, that were left out of its fit.

Source: docs/mathematics.md (9.4).
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from basecal.accuracy.cross_validation.folds import Split, place_split
from basecal.accuracy.cross_validation.refit import Refit, refit_folds, with_known_stops
from basecal.estimation.least_squares.jacobians import stop_error_jacobians
from basecal.estimation.least_squares.normal_equations import linearise, retract
from basecal.estimation.least_squares.sparse_normal_equations import is_sparse
from basecal.estimation.problem.problem import Problem, State, chain
from basecal.estimation.problem.view_group import ViewGroup
from basecal.estimation.solve import Solution
from basecal.geometry import Array, IntArray
from basecal.numerics.spectral import VIEW_ROUNDING, spectrum

_PLACING_STEPS = 5  # from where all views have it: it is nearly linear


class StationScores(NamedTuple):
    """Held-out stations, against what the rest predicts.

    Attributes:
        scores: (stations,) log(1 + x), less is better: x is the squared distance of the target from its pose by the
            station's views alone. It is over its variance, robots' noise included, and per degree of freedom. The
            logarithm keeps a few stations that are predicted badly from outweighing all others.
        mean_square: Of all residuals over sigmas, robots' noise marginalised.
        off_m: (views,) distance of the target from its prediction, by a Newton step of the view alone [m]. It is NaN if
            the view holds neither a pose nor a point.
    """

    scores: Array
    mean_square: float
    off_m: Array


def score_stations(problem: Problem, state: State, split: Split, iterations: int) -> StationScores:
    """Fit all folds but one, each in turn, and score the stations of that one.

    Args:
        problem: The problem.
        state: Where the fits start.
        split: Stations, and the folds they are dealt out to.
        iterations: Steps of each fit, at most.
    """
    station = {number: k for k, part in enumerate(split.parts) for number in part}
    fresh = replace(state, stop_errors=np.zeros_like(state.stop_errors))  # held-out views have said nothing yet
    far, freedoms = np.zeros((2, len(split.parts)))
    cost, count, off = 0.0, 0, [np.zeros(0)]
    for fit in refit_folds(problem, fresh, split.folds, iterations):
        end = place_unknowns(fit)
        for group in fit.views.groups:
            views = predict_views(problem, group, end)
            place = np.array([station[number] for number in group.sample.tolist()])
            np.add.at(far, place, views.far)
            np.add.at(freedoms, place, views.freedoms)
            cost, count = cost + float(views.cost.sum()), count + sum(group.measurement.counts().values())
            off.append(views.off_m)
    return StationScores(np.log1p(far / np.maximum(freedoms, 1)), cost / max(count, 1), np.concatenate(off))


def place_unknowns(fit: Refit) -> State:
    """The state of a fit, with what its held-out views alone depend on, such as a mark, where these have it."""
    rows, state = held_out_columns(fit), fit.optimum.state
    for _ in range(_PLACING_STEPS if len(rows) else 0):
        normal, step = linearise(fit.views, state), np.zeros(fit.views.width)
        step[rows] = -spectrum(normal.hessian[np.ix_(rows, rows)]).inverse @ normal.gradient[rows]
        state = retract(fit.views, state, normal, step)
    return with_known_stops(state, fit.known)


def held_out_columns(fit: Refit) -> IntArray:
    """Columns of what the held-out views of a fit alone depend on."""
    used, held = ({name for g in of.groups for name in g.frames} for of in (fit.used, fit.views))
    return fit.views.column_indices(name for name in fit.views.columns if name in held - used)


class ViewPredictions(NamedTuple):
    """Cost of each view, (n,), the part of it that a movement of the target removes, and its freedoms."""

    cost: Array
    far: Array
    freedoms: Array
    off_m: Array


def predict_views(problem: Problem, group: ViewGroup, state: State) -> ViewPredictions:
    """How far the views of a group are from a state that did not use them."""
    links = chain(group, state, problem.stops)
    view = group.measurement.linearise(links.camera_from_target, state.cameras.get(group.camera), False)
    gradient, information = view.gradient[:, :6], view.information[:, :6, :6]
    spread = np.zeros((len(group), 6, 6))
    for _, by_error in stop_error_jacobians(group, links, state, problem.stops, 6):
        spread += by_error @ by_error.mT
    shared = np.linalg.solve(np.eye(6) + information @ spread, gradient[..., None])[..., 0]
    cost = view.cost - np.einsum("ni,nij,nj->n", gradient, spread, shared)
    of = spectrum(information, VIEW_ROUNDING)
    step = (of.inverse @ gradient[..., None])[..., 0]
    alone = view.cost - np.einsum("ni,ni->n", gradient, step)
    is_placed = of.held.all(axis=1) | (~information[:, 3:].any(axis=(1, 2)) & (of.rank == 3))  # a pose, or a point
    off_m = np.where(is_placed, np.linalg.norm(step[:, :3], axis=1), np.nan)
    return ViewPredictions(cost, np.maximum(cost - alone, 0.0), of.rank.astype(np.float64), off_m)


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
