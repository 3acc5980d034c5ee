"""Prediction of stations, or places of touches, that were left out of a fit.

Source: docs/mathematics.md (9.4).
"""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from basecal.accuracy.cross_validation.folds import Split, place_split
from basecal.accuracy.cross_validation.refit import Refit, refit_folds, with_known_stops
from basecal.estimation.least_squares.jacobians import stop_error_jacobians
from basecal.estimation.least_squares.normal_equations import linearise, retract
from basecal.estimation.least_squares.sparse_normal_equations import is_sparse
from basecal.estimation.noise.robot_noise import without_errors
from basecal.estimation.problem.problem import Problem, State, chain
from basecal.estimation.problem.view_group import ViewGroup
from basecal.estimation.solve import Solution
from basecal.geometry import Array, IntArray
from basecal.numerics.spectral import VIEW_ROUNDING, spectrum

_PLACING_STEPS = 5  # from the estimate of all views; the problem is nearly linear


class StationScores(NamedTuple):
    """Errors of the predictions of held-out stations.

    Attributes:
        scores: (stations,) log(1 + x), less is better. x is the squared distance between the predicted target and the
            target from the station's views alone. It is divided by its variance, which includes robots' noise, and by
            its degrees of freedom. The logarithm prevents a few badly predicted stations from outweighing all others.
        mean_square: Mean square of all residuals over sigmas, robots' noise marginalised.
        distance_m: (views,) distance of the target from its prediction, by a Newton step of the view alone [m]. It is
            NaN if the view determines neither a pose nor a point.
    """

    scores: Array
    mean_square: float
    distance_m: Array


def score_stations(problem: Problem, state: State, split: Split, iterations: int) -> StationScores:
    """Fit the problem without each fold in turn, and score the predictions of the fold's stations.

    Args:
        problem: The problem to fit.
        state: Initial state of the fits.
        split: Stations, and the folds that they belong to.
        iterations: Largest number of steps of each fit.
    """
    station = {number: k for k, part in enumerate(split.parts) for number in part}
    fresh = without_errors(problem, state)  # held-out views have no influence yet
    chi_square, freedoms = np.zeros((2, len(split.parts)))
    cost, count, distances = 0.0, 0, [np.zeros(0)]
    for fit in refit_folds(problem, fresh, split.folds, iterations):
        end = place_unknowns(fit)
        for group in fit.views.groups:
            views = predict_views(problem, group, end)
            index = np.array([station[number] for number in group.sample.tolist()])
            np.add.at(chi_square, index, views.chi_square)
            np.add.at(freedoms, index, views.freedoms)
            cost, count = cost + float(views.cost.sum()), count + sum(group.measurement.counts().values())
            distances.append(views.distance_m)
    return StationScores(
        np.log1p(chi_square / np.maximum(freedoms, 1)), cost / max(count, 1), np.concatenate(distances)
    )


def place_unknowns(fit: Refit) -> State:
    """Complete the state of a fit: estimate transforms that only held-out views depend on, such as a mark."""
    columns, state = held_out_columns(fit), fit.optimum.state
    for _ in range(_PLACING_STEPS if len(columns) else 0):
        normal, step = linearise(fit.views, state), np.zeros(fit.views.width)
        step[columns] = -spectrum(normal.hessian[np.ix_(columns, columns)]).inverse @ normal.gradient[columns]
        state = retract(fit.views, state, normal, step)
    return with_known_stops(state, fit.known)


def held_out_columns(fit: Refit) -> IntArray:
    """Columns of the transforms that only the held-out views of a fit depend on."""
    used, held = ({name for g in problem.groups for name in g.frames} for problem in (fit.used, fit.views))
    return fit.views.column_indices(name for name in fit.views.columns if name in held - used)


class ViewPredictions(NamedTuple):
    """Errors of predicted views.

    Attributes:
        cost: (n,) cost of each view, robots' noise marginalised.
        chi_square: (n,) decrease of the cost if the target moves to its pose by the view alone.
        freedoms: (n,) degrees of freedom of `chi_square`.
        distance_m: (n,) distance of the target from its prediction [m]; NaN if a view determines no pose or point.
    """

    cost: Array
    chi_square: Array
    freedoms: Array
    distance_m: Array


def predict_views(problem: Problem, group: ViewGroup, state: State) -> ViewPredictions:
    """Errors of the views of a group as predicted by a state that was estimated without them."""
    links = chain(group, state, problem.stops)
    view = group.measurement.linearise(links.camera_from_target, state.cameras.get(group.camera), False)
    gradient, information = view.gradient[:, :6], view.information[:, :6, :6]
    spread = np.zeros((len(group), 6, 6))
    for _, by_error in stop_error_jacobians(group, links, state, problem.stops, 6):
        spread += by_error @ by_error.mT
    shared = np.linalg.solve(np.eye(6) + information @ spread, gradient[..., None])[..., 0]
    cost = view.cost - np.einsum("ni,nij,nj->n", gradient, spread, shared)
    spectral = spectrum(information, VIEW_ROUNDING)
    step = (spectral.inverse @ gradient[..., None])[..., 0]
    alone = view.cost - np.einsum("ni,ni->n", gradient, step)
    is_placed = spectral.is_informative.all(axis=1) | (
        ~information[:, 3:].any(axis=(1, 2)) & (spectral.rank == 3)
    )  # a pose, or a point
    distance_m = np.where(is_placed, np.linalg.norm(step[:, :3], axis=1), np.nan)
    return ViewPredictions(cost, np.maximum(cost - alone, 0.0), spectral.rank.astype(np.float64), distance_m)


_OPEN_SIGMA = 1.0  # [m, rad] prior sigma of unknowns that other places do not determine: an arm's reach; assumed


class PlaceError(NamedTuple):
    """Prediction error of a mark whose place was held out.

    Attributes:
        mark: Name of the mark.
        error_m: Rms distance of its touches from their prediction by the other places [m].
        ratio: Root mean square error over that expected from noise and from the uncertainty of the fit.
        freedoms: Degrees of freedom of the mean.
    """

    mark: str
    error_m: float
    ratio: float
    freedoms: float


def place_errors(solution: Solution, iterations: int) -> tuple[PlaceError, ...]:
    """Prediction errors at each mark, held out with all marks of its place; empty for fewer than three places.

    Args:
        solution: The solution, with the noise in use.
        iterations: Largest number of steps of each fit.
    """
    problem = solution.noise.hold_sigmas(solution.problem)
    split = place_split(problem)
    if split is None or is_sparse(problem) or not solution.converged:
        return ()
    fresh = without_errors(problem, solution.state)
    sums: dict[str, Array] = {}
    for fit in refit_folds(problem, fresh, split.folds, iterations):
        end = place_unknowns(fit)
        for group, expected in zip(fit.views.groups, _expected_squares(fit, end), strict=True):
            views = predict_views(problem, group, end)
            numbers = [views.chi_square.sum(), expected, views.freedoms.sum(), np.sum(views.distance_m**2), len(group)]
            sums[group.target] = sums.get(group.target, np.zeros(5)) + numbers
    return tuple(
        PlaceError(mark, float(np.sqrt(square_m2 / count)), float(np.sqrt(chi_square / expected)), float(freedoms))
        for mark, (chi_square, expected, freedoms, square_m2, count) in sums.items()
        if np.isfinite(chi_square) and np.isfinite(square_m2)
    )


def _expected_squares(fit: Refit, state: State) -> list[float]:
    """Expected squared error of the held-out views of each group, from noise and the uncertainty of the fit.

    Transforms that only these views depend on were estimated from them, so the residuals are orthogonal to them.
    """
    placed = held_out_columns(fit)
    known = np.setdiff1d(np.arange(fit.used.width), placed)
    covariance = np.linalg.inv(fit.optimum.hessian[np.ix_(known, known)] + np.eye(len(known)) / _OPEN_SIGMA**2)
    rows = []
    for views in linearise(fit.views, state).views:
        root = spectrum(views.information, VIEW_ROUNDING).root
        by_views = np.zeros((len(root) * root.shape[-1], fit.used.width))
        by_views[:, views.columns] = (root.mT @ views.by_unknowns).reshape(len(by_views), -1)
        rows.append(by_views)
    every = np.concatenate(rows)
    by_place = every[:, placed]
    left = np.eye(len(every)) - by_place @ spectrum(by_place.T @ by_place).inverse @ by_place.T
    by_known = left @ every[:, known]
    squares = np.diag(left) * every.any(axis=1) + np.einsum("ij,jk,ik->i", by_known, covariance, by_known)
    ends = np.cumsum([0, *map(len, rows)])
    return [float(squares[start:stop].sum()) for start, stop in pairwise(ends)]
