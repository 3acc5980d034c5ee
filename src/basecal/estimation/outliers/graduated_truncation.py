"""From a state that gross outliers have pulled aside to that of the others, by weights found anew in each round.

Graduated non-convexity: truncated least squares over views, and over the points of views that have few, by weights
that begin near one for all and end at zero or one. Source: Yang, Antonante, Tzoumas & Carlone 2020. We differ: a view's
square is taken with its private stops' errors eliminated and all weights are on that, and the scale is estimated anew
in each round.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from basecal.estimation.least_squares.bundle_adjustment import bundle_adjust
from basecal.estimation.least_squares.studentized_residuals import MahalanobisSquared, judged_by_view, studentize_views
from basecal.estimation.outliers.robust_scale import Scale
from basecal.estimation.problem.problem import Problem, State
from basecal.estimation.problem.view_group import ViewGroup
from basecal.estimation.view.seen_points import SeenPoints, point_jacobians
from basecal.geometry import Array

_GROWTH = 1.6  # of the control parameter in each round
_WEIGHT_ROUNDS = 60  # 1.6^60 is beyond any square over its limit
_STEPS_BETWEEN_WEIGHTS = 2  # steps between two sets of weights
_CERTAIN = 1e-3  # weights this near to zero or one have decided

ScaleOf = Callable[[list[MahalanobisSquared]], Scale]


def graduated_truncation(problem: Problem, state: State, scale_of: ScaleOf) -> State:
    """The state of truncated least squares, downhill of `state`.

    Args:
        problem: The problem.
        state: Where to start.
        scale_of: The scale of squared deviations.
    """
    views = [np.ones(len(g)) for g in problem.groups]
    points = [np.ones((len(g.measurement.equations()), 1)) for g in problem.groups]
    control = 0.0
    for _ in range(_WEIGHT_ROUNDS):
        weighted = problem.with_groups(_weigh_group(g, w) for g, w in zip(problem.groups, points, strict=True))
        state = bundle_adjust(weighted, state, 1, _STEPS_BETWEEN_WEIGHTS, views).state
        of_views = list(studentize_views(weighted, state, views))
        of_points = [_point_misfits(problem, state, g) for g in problem.groups]
        ratios = [_limit_ratio(s, scale_of(of_views)) for s in of_views]
        point_ratios = [_limit_ratio(s, scale_of(of_points)) for s in of_points]
        worst = max((float(r.max(initial=0.0)) for r in (*ratios, *point_ratios)), default=0.0)
        control = control * _GROWTH if control else 1 / max(2 * min(worst, 1e12) - 1, 1.0)
        before, views = views, [_weights(r, control) for r in ratios]
        points = [_weights(r, control) for r in point_ratios]
        every = np.concatenate([w.ravel() for w in (*views, *points)])
        if np.all((every < _CERTAIN) | (every > 1 - _CERTAIN)) and all(map(np.allclose, before, views)):
            break
    return state


def _limit_ratio(squares: MahalanobisSquared, scale: Scale) -> Array:
    limit = scale.limit(squares.freedoms)
    return np.where(np.isfinite(limit), np.minimum(squares.value, 1e30) / limit, 0.0)


def _weights(ratio: Array, control: float) -> Array:
    """By squares over their limit and the control parameter mu of the paper, eq. (14)."""
    between = np.sqrt(control * (control + 1) / np.maximum(ratio, 1e-300)) - control
    return np.where(ratio <= control / (control + 1), 1.0, np.where(ratio >= (control + 1) / control, 0.0, between))


def _weigh_group(group: ViewGroup, weights: Array) -> ViewGroup:
    return replace(group, measurement=group.measurement.reweight(weights))


def _point_misfits(problem: Problem, state: State, group: ViewGroup) -> MahalanobisSquared:
    """Of points of views that have two and more and are not judged by the rest of their view; else no freedoms."""
    measurement = group.measurement
    nothing = MahalanobisSquared(np.zeros((len(group), 1)), np.zeros((len(group), 1), dtype=np.int64))
    if not isinstance(measurement, SeenPoints):
        return nothing
    few = ~judged_by_view(measurement)
    if not few.any() or len(measurement.points_in_target) < 2:
        return nothing
    predicted = state.camera_from_target(group, problem.stops)
    rows = point_jacobians(measurement, predicted, state.cameras.get(group.camera), False)
    value = np.where(measurement.seen & ~rows.seen, np.inf, np.sum(rows.residual**2, -1))
    return MahalanobisSquared(value, measurement.seen * few[:, None] * rows.residual.shape[-1])
