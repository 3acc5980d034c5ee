"""How well a problem predicts stations that were left out of its fit. Source: docs/mathematics.md (9.3)."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from basecal.estimation.least_squares.bundle_adjustment import bundle_adjust
from basecal.estimation.least_squares.jacobians import by_stop_errors
from basecal.estimation.noise.estimate import degrees_of_freedom
from basecal.estimation.problem.problem import Problem, State, ViewGroup, chain
from basecal.geometry import Array, IntArray

FOLDS = 5
_HELD = 1e-9


class Prediction(NamedTuple):
    """What was left out, against what the rest predicts.

    Attributes:
        scores: (stations,) log(1 + x), less is better: x is how far the target is from where the station's views alone
            would have it, squared and over its variance, robots' noise included, by freedom. The logarithm keeps a few
            stations that are predicted badly from outweighing all others.
        mean_square: Of all residuals over sigmas, robots' noise marginalised.
        off_m: (views,) how far the target is off by a Newton step of the view alone [m]; NaN where it holds no pose.
    """

    scores: Array
    mean_square: float
    off_m: Array


def predict_left_out(problem: Problem, state: State, iterations: int) -> Prediction:
    """Fit four fifths of the stations, five times, and predict the others.

    Args:
        problem: The problem.
        state: Where the fits start.
        iterations: Steps of each fit, at most.
    """
    samples, station = stations(problem)
    fresh = replace(state, stop_errors=np.zeros_like(state.stop_errors))  # what is left out has told nothing yet
    far, freedoms = np.zeros((2, int(station.max()) + 1))
    cost, count, off = 0.0, 0, [np.zeros(0)]
    for fold in range(FOLDS):
        out = [np.isin(g.sample, samples[station % FOLDS == fold]) for g in problem.groups]
        kept = problem.with_groups(g.take(np.flatnonzero(~o)) for g, o in zip(problem.groups, out, strict=True))
        end = bundle_adjust(kept, fresh, degrees_of_freedom(kept), iterations).state
        for group in (g.take(np.flatnonzero(o)) for g, o in zip(problem.groups, out, strict=True)):
            if len(group):
                views = _predicted(problem, group, end)
                place = station[np.searchsorted(samples, group.sample)]
                np.add.at(far, place, views.far)
                np.add.at(freedoms, place, views.freedoms)
                cost, count = cost + float(views.cost.sum()), count + sum(group.measurement.counts().values())
                off.append(views.off_m)
    return Prediction(np.log1p(far / np.maximum(freedoms, 1)), cost / max(count, 1), np.concatenate(off))


def stations(problem: Problem) -> tuple[IntArray, IntArray]:
    """Numbers of all samples, and the station of each, (n,): samples with a robot that stood as in another.

    They share the error of that stop, so that one would tell of the other. Where there are fewer stations than folds
    each sample is one by itself.
    """
    samples = np.unique(np.concatenate([g.sample for g in problem.groups]))
    same = csr_array((len(samples), len(samples)))
    for group in problem.groups:
        rows = np.searchsorted(samples, group.sample)
        for recorded in (_places(group, "eye"), _places(group, "hand")):
            _, first, stop = np.unique(recorded, axis=0, return_index=True, return_inverse=True)
            same = same + csr_array((np.ones(len(rows)), (rows, rows[first[stop]])), shape=same.shape)
    count, station = connected_components(same, directed=False)
    return samples, station.astype(np.int64) if count >= FOLDS else np.arange(len(samples))


def _places(group: ViewGroup, side: str) -> Array:
    """Where a robot stood in each view, (n, k); on the world each view by itself."""
    if getattr(group, side) is None:
        return np.arange(len(group), dtype=np.float64)[:, None]
    pose = group.eye_base_from_eye_flange if side == "eye" else group.hand_base_from_hand_flange
    return np.concatenate([pose.rotation.reshape(-1, 9), pose.translation], -1)


class _Views(NamedTuple):
    """Of each view, (n,): its cost, the part of it that a movement of the target takes away, by how many freedoms."""

    cost: Array
    far: Array
    freedoms: Array
    off_m: Array


def _predicted(problem: Problem, group: ViewGroup, state: State) -> _Views:
    links = chain(group, state, problem.stops)
    view = group.measurement.linearise(links.camera_from_target, state.cameras.get(group.camera), False)
    gradient, information = view.gradient[:, :6], view.information[:, :6, :6]
    spread = np.zeros((len(group), 6, 6))
    for _, by_error in by_stop_errors(group, links, state, problem.stops, 6):
        spread += by_error @ np.swapaxes(by_error, -1, -2)
    shared = np.linalg.solve(np.eye(6) + information @ spread, gradient[..., None])[..., 0]
    cost = view.cost - np.einsum("ni,nij,nj->n", gradient, spread, shared)
    values, vectors = np.linalg.eigh(information)
    held = values > _HELD * values[:, -1:]
    step = np.einsum("nij,nj,nkj,nk->ni", vectors, held / np.where(held, values, 1.0), vectors, gradient)
    alone = view.cost - np.einsum("ni,ni->n", gradient, step)
    off_m = np.where(held.all(-1), np.linalg.norm(step[:, :3], axis=-1), np.nan)
    return _Views(cost, np.maximum(cost - alone, 0.0), held.sum(-1), off_m)
