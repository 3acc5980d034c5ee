"""How well a problem predicts stations that were left out of its fit. Source: docs/mathematics.md (9.4)."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from basecal.accuracy.cross_validation.folds import Split
from basecal.accuracy.cross_validation.refit import refit_folds
from basecal.estimation.least_squares.jacobians import stop_error_jacobians
from basecal.estimation.problem.problem import Problem, State, chain
from basecal.estimation.problem.view_group import ViewGroup
from basecal.geometry import Array
from basecal.numerics.spectral import VIEW_ROUNDING, spectrum


class StationScores(NamedTuple):
    """Held-out stations, against what the rest predicts.

    Attributes:
        scores: (stations,) log(1 + x), less is better: x is how far the target is from where the station's views alone
            would have it, squared and over its variance, robots' noise included, by freedom. The logarithm keeps a few
            stations that are predicted badly from outweighing all others.
        mean_square: Of all residuals over sigmas, robots' noise marginalised.
        off_m: (views,) how far the target is off by a Newton step of the view alone [m]; NaN if it holds no pose.
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
        for group in fit.views.groups:
            views = _predict_views(problem, group, fit.optimum.state)
            place = np.array([station[number] for number in group.sample.tolist()])
            np.add.at(far, place, views.far)
            np.add.at(freedoms, place, views.freedoms)
            cost, count = cost + float(views.cost.sum()), count + sum(group.measurement.counts().values())
            off.append(views.off_m)
    return StationScores(np.log1p(far / np.maximum(freedoms, 1)), cost / max(count, 1), np.concatenate(off))


class _Views(NamedTuple):
    """Of each view, (n,): its cost, the part of it that a movement of the target takes away, by how many freedoms."""

    cost: Array
    far: Array
    freedoms: Array
    off_m: Array


def _predict_views(problem: Problem, group: ViewGroup, state: State) -> _Views:
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
    off_m = np.where(of.held.all(axis=1), np.linalg.norm(step[:, :3], axis=1), np.nan)
    return _Views(cost, np.maximum(cost - alone, 0.0), of.rank.astype(np.float64), off_m)
