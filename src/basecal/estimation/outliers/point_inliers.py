"""Which points of a view agree with the rest of their view, whatever the state that outliers have pulled aside.

`benchmarks.outliers` judges its limits.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from basecal.cell import Cell
from basecal.estimation.least_squares.studentized_residuals import MahalanobisSquared, judged_by_view
from basecal.estimation.noise.estimate import CONTRADICTED, PLAUSIBLE_PX, UNSUSPECTED_PX
from basecal.estimation.outliers.classify import CHANCE_OF_POINT, is_stated
from basecal.estimation.outliers.inlier_mask import InlierMask, all_inliers, point_count
from basecal.estimation.outliers.robust_scale import Scale, robust_scale
from basecal.estimation.outliers.view_ransac import FEW_POINTS, PointViews
from basecal.estimation.problem.problem import Problem, State
from basecal.estimation.problem.view_group import ViewGroup
from basecal.estimation.start.first_state import lenses
from basecal.estimation.view.pixels import PixelMeasurement
from basecal.estimation.view.target_points import SeenPoints
from basecal.estimation.view.view_pose import refine_poses
from basecal.geometry import SE3, BoolArray, IntArray

_SCALE_ROUNDS = 4  # rounds of scale and inliers in turn, at most
# Share of a view's points that agree at the fit to all of them, from which on no random subsets are drawn: of so many
# the fit itself leaves out the others; with fewer a skewed fit widens the scale by which points agree.
_AGREED = 0.95


def agreeing_points(problem: Problem, state: State, suspects: list[IntArray], cell: Cell) -> tuple[BoolArray, ...]:
    """Points of suspect views that agree with the rest of their view, and all points of others, (n, p), by group.

    A free lens may have been distorted by wrong poses. If the points scatter accordingly, the lens of the views alone
    is tried, too.
    """
    if not any(map(len, suspects)):
        return all_inliers(problem).points
    found = [_scale_and_points(problem, state, suspects)]
    unsuspected = CONTRADICTED**2 if is_stated(problem) else UNSUSPECTED_PX**2
    if found[0][0] > unsuspected and not problem.columns.keys().isdisjoint(problem.lenses):
        alone = replace(state, cameras=lenses(problem, cell))
        found.append(_scale_and_points(problem, alone, suspects))
    return min(found, key=lambda f: f[0])[1]


def readmit_points(problem: Problem, state: State, inliers: InlierMask, scale: Scale) -> InlierMask:
    """Readmit the points that are where the rest of their view predicts them: an earlier state left them out.

    Args:
        problem: All that was seen.
        state: The state that the inliers led to.
        inliers: What it was fitted to.
        scale: Of the deviations of points.
    """
    points = list(inliers.points)
    for k, group in enumerate(problem.groups):
        measurement = group.measurement
        if not isinstance(measurement, SeenPoints):
            continue
        rest, lost = measurement.mask_points(points[k]), measurement.seen & ~points[k]
        views = np.flatnonzero(judged_by_view(rest) & lost.any(1))
        if not len(views):
            continue
        lens, near = state.cameras.get(group.camera), state.camera_from_target(group, problem.stops)[views]
        poses = refine_poses(rest.take(views), near, lens).camera_from_target
        limit = float(scale.limit(np.array(measurement.coordinates)))
        found = PointViews(measurement.take(views), lens).agreement(poses, limit)
        points[k] = points[k].copy()
        points[k][views] |= found.points
    return replace(inliers, points=tuple(points))


_Fits = Callable[[PointViews, SE3], SE3]


@dataclass(frozen=True, eq=False)
class _Hypotheses:
    """Poses (m, n) that some views of a group, (n,), may have."""

    views: IntArray
    poses: SE3


def _scale_and_points(problem: Problem, state: State, suspects: list[IntArray]) -> tuple[float, tuple[BoolArray, ...]]:
    """The scale of all points' squares with the lenses of a state, and the points that agree within it.

    Subsets are drawn of those views alone of which the fit to all points does not explain most.
    """
    fits = PointViews.near_fits
    poses = [_hypotheses(g, of, problem, state, fits) for g, of in zip(problem.groups, suspects, strict=True)]
    scale, kept = _choose_points(problem, state, poses)
    unclear = [_unclear(g, k, of) for g, k, of in zip(problem.groups, kept, suspects, strict=True)]
    if any(map(len, unclear)):
        for k, group in enumerate(problem.groups):
            clear = np.setdiff1d(suspects[k], unclear[k])
            poses[k] = [
                *_hypotheses(group, clear, problem, state, fits),
                *_hypotheses(group, unclear[k], problem, state, PointViews.subset_fits),
            ]
        scale, kept = _choose_points(problem, state, poses)
    return scale.variance, kept


def _unclear(group: ViewGroup, inliers: BoolArray, suspects: IntArray) -> IntArray:
    """Suspect views of few points, and those of which many points do not agree."""
    measurement = group.measurement
    if not isinstance(measurement, SeenPoints):
        return suspects[:0]
    seen = measurement.seen[suspects]
    share = (seen & inliers[suspects]).sum(1) / np.maximum(seen.sum(1), 1)
    unclear: IntArray = suspects[(share < _AGREED) | (seen.shape[1] <= FEW_POINTS)]
    return unclear


def _choose_points(
    problem: Problem, state: State, poses: Sequence[Sequence[_Hypotheses]]
) -> tuple[Scale, tuple[BoolArray, ...]]:
    """Scale of all points' squares and the points that agree at the best of each view's poses, until both rest."""
    kept = list(all_inliers(problem).points)
    stated = is_stated(problem)
    # One pixel squared in units of what is taken for a pixel's variance.
    seen = [g.measurement for g in problem.groups if isinstance(g.measurement, PixelMeasurement)]
    unit = float(max((of.weight.max(initial=0.0) for of in seen), default=1.0)) ** 2 * PLAUSIBLE_PX**2
    scale = Scale(1.0 if stated else unit, np.inf, np.inf, CHANCE_OF_POINT)
    for _ in range(_SCALE_ROUNDS):
        squares = []
        for k, group in enumerate(problem.groups):
            kept[k], of = _agreeing_points(group, poses[k], state, scale)
            squares.append(of)
        before, scale = scale, robust_scale(squares, 0, stated, CHANCE_OF_POINT)
        if 1 / CONTRADICTED < scale.variance / before.variance < CONTRADICTED:
            break
    return scale, tuple(kept)


def _hypotheses(
    group: ViewGroup,
    views: IntArray,
    problem: Problem,
    state: State,
    fits: _Fits,
) -> list[_Hypotheses]:
    """Poses that some views may have; none where there are no such views."""
    measurement = group.measurement
    if not len(views) or not isinstance(measurement, SeenPoints):
        return []
    near = state.camera_from_target(group, problem.stops)[views]
    return [_Hypotheses(views, fits(PointViews(measurement.take(views), state.cameras.get(group.camera)), near))]


def _agreeing_points(
    group: ViewGroup, hypotheses: Sequence[_Hypotheses], state: State, scale: Scale
) -> tuple[BoolArray, MahalanobisSquared]:
    """Which points of a group's views, (n, p), agree with the rest of their view, and all points' squares."""
    measurement = group.measurement
    kept = np.ones((len(group), point_count(measurement)), dtype=bool)
    if not isinstance(measurement, SeenPoints):
        return kept, MahalanobisSquared(np.zeros(0), np.zeros(0, dtype=np.int64))
    limit = float(scale.limit(np.array(measurement.coordinates)))
    squares = [np.zeros(0)]
    for of in hypotheses:
        few = measurement.take(of.views)
        found = PointViews(few, state.cameras.get(group.camera)).largest_agreement(of.poses, limit)
        kept[of.views] = found.points | ~few.seen
        # Of all points, not of those within the limit: a limit that is too tight must not confirm itself.
        squares.append(found.squares[few.seen])
    every = np.concatenate(squares)
    return kept, MahalanobisSquared(every, np.full(len(every), measurement.coordinates))
