"""Which points of a view agree with the rest of their view, whatever the state that outliers have pulled aside."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from basecal.cell import Cell
from basecal.estimation.least_squares.studentized import MahalanobisSquared
from basecal.estimation.noise.estimate import CONTRADICTED
from basecal.estimation.outliers.classify import CHANCE_OF_POINT, is_stated
from basecal.estimation.outliers.inlier_mask import all_inliers, point_count
from basecal.estimation.outliers.robust_scale import Scale, robust_scale
from basecal.estimation.outliers.view_ransac import largest_agreement, subset_fits
from basecal.estimation.problem.problem import Problem, State, ViewGroup
from basecal.estimation.start.first_state import lenses
from basecal.estimation.view.pixels import PixelMeasurement
from basecal.estimation.view.points import PointMeasurement
from basecal.geometry import SE3, BoolArray, IntArray

_SCALE_ROUNDS = 4  # rounds of scale and inliers in turn, at most
# What a detector may be off by, where nobody stated it [px].
PLAUSIBLE_PX = 3.0  # residual that a detector may have [px]


def points_within(problem: Problem, state: State, suspects: list[IntArray], cell: Cell) -> tuple[BoolArray, ...]:
    """By group, (n, p): points of suspect views that agree with the rest of their view, and all of others.

    A lens that is free may have been bent by wrong poses: that of the views alone is tried, too.
    """
    if not any(map(len, suspects)):
        return all_inliers(problem).points
    found = [_points_by(problem, state, suspects)]
    if not problem.columns.keys().isdisjoint(problem.lenses):
        alone = replace(state, cameras=lenses(problem, cell))
        found.append(_points_by(problem, alone, suspects))
    return min(found, key=lambda f: f[0])[1]


def _points_by(problem: Problem, state: State, suspects: list[IntArray]) -> tuple[float, tuple[BoolArray, ...]]:
    """The scale of all points' squares with the lenses of a state, and the points that agree within it."""
    kept = list(all_inliers(problem).points)
    stated = is_stated(problem)
    scale = Scale(1.0 if stated else _unit(problem), np.inf, np.inf, CHANCE_OF_POINT)
    poses = [_hypotheses(group, of, problem, state) for group, of in zip(problem.groups, suspects, strict=True)]
    for _ in range(_SCALE_ROUNDS):
        squares = []
        for k, group in enumerate(problem.groups):
            kept[k], of = _agreeing_points(group, suspects[k], poses[k], state, scale)
            squares.append(of)
        before, scale = scale, robust_scale(squares, 0, stated, CHANCE_OF_POINT)
        if 1 / CONTRADICTED < scale.variance / before.variance < CONTRADICTED:
            break
    return scale.variance, tuple(kept)


def _unit(problem: Problem) -> float:
    """One pixel squared in units of what is taken for a pixel's variance."""
    weights = [
        g.measurement.weight.max(initial=0.0) for g in problem.groups if isinstance(g.measurement, PixelMeasurement)
    ]
    return float(max(weights, default=1.0)) ** 2 * PLAUSIBLE_PX**2


def _hypotheses(group: ViewGroup, suspects: IntArray, problem: Problem, state: State) -> SE3 | None:
    """Poses that suspect views may have, (m, n); None where there are no such views."""
    measurement = group.measurement
    if not len(suspects) or not isinstance(measurement, PixelMeasurement | PointMeasurement):
        return None
    near = state.camera_from_target(group, problem.stops)[suspects]
    return subset_fits(measurement.take(suspects), near, state.cameras.get(group.camera))


def _agreeing_points(
    group: ViewGroup, suspects: IntArray, poses: SE3 | None, state: State, scale: Scale
) -> tuple[BoolArray, MahalanobisSquared]:
    """Which points of a group's views, (n, p), agree with the rest of their view, and all points' squares."""
    measurement = group.measurement
    kept = np.ones((len(group), point_count(measurement)), dtype=bool)
    if poses is None or not isinstance(measurement, PixelMeasurement | PointMeasurement):
        return kept, MahalanobisSquared(np.zeros(0), np.zeros(0, dtype=np.int64))
    few = measurement.take(suspects)
    freedoms = 2 if isinstance(measurement, PixelMeasurement) else 3
    limit = float(scale.limit(np.array(freedoms)))
    found = largest_agreement(few, poses, state.cameras.get(group.camera), limit)
    kept[suspects] = found.points | ~few.seen
    # Of all points, not of those within the limit: a limit that is too tight must not confirm itself.
    squares = found.squares[few.seen]
    return kept, MahalanobisSquared(squares, np.full(len(squares), freedoms))
