"""How well a problem predicts stations that were left out of its fit. Source: docs/mathematics.md (9.4)."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from basecal.accuracy.cross_validation.folds import Split
from basecal.accuracy.cross_validation.refit import Refit, refit_folds, with_known_stops
from basecal.estimation.least_squares.jacobians import stop_error_jacobians
from basecal.estimation.least_squares.normal_equations import linearise, retract
from basecal.estimation.problem.problem import Problem, State, chain
from basecal.estimation.problem.view_group import ViewGroup
from basecal.geometry import Array
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
    for _ in range(_PLACING_STEPS if rows else 0):
        normal, step = linearise(fit.views, state), np.zeros(fit.views.width)
        step[rows] = -spectrum(normal.hessian[np.ix_(rows, rows)]).inverse @ normal.gradient[rows]
        state = retract(fit.views, state, normal, step)
    return with_known_stops(state, fit.known)


def held_out_columns(fit: Refit) -> list[int]:
    """Columns of what the held-out views of a fit alone depend on."""
    used, held = ({name for g in of.groups for name in g.frames} for of in (fit.used, fit.views))
    columns = fit.views.columns
    return [k for name in columns if name in held - used for k in range(columns[name].start, columns[name].stop)]


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
