"""Points that agree with the rest of their view, independent of a state that may be biased by outliers.

The thresholds are validated by `benchmarks.outliers`.
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

_SCALE_ROUNDS = 4  # maximum number of alternations of scale and inliers
# Share of inliers at the fit to all points of a view from which no random subsets are sampled: with so many, the fit
# identifies the outliers; with fewer, a biased fit increases the scale of the inliers.
_AGREED = 0.95


def agreeing_points(problem: Problem, state: State, suspects: list[IntArray], cell: Cell) -> tuple[BoolArray, ...]:
    """Points of suspect views that agree with the rest of their view, and all points of other views, (n, p), by group.

    Wrong robot poses may have biased a free lens. If the scatter of the points is too large, a lens estimated from the
    views alone is tried as well.
    """
    if not any(map(len, suspects)):
        return all_inliers(problem).points
    candidates = [_scale_and_points(problem, state, suspects)]
    usual_variance = CONTRADICTED**2 if is_stated(problem) else UNSUSPECTED_PX**2
    if candidates[0][0] > usual_variance and not problem.columns.keys().isdisjoint(problem.lenses):
        view_state = replace(state, cameras=lenses(problem, cell))
        candidates.append(_scale_and_points(problem, view_state, suspects))
    return min(candidates, key=lambda f: f[0])[1]


def readmit_points(problem: Problem, state: State, inliers: InlierMask, scale: Scale) -> InlierMask:
    """Readmit points that an earlier state excluded, if they agree with the rest of their view.

    Args:
        problem: The problem with all views and points.
        state: The state.
        inliers: The inliers that the state was fitted to.
        scale: Scale of the points' squared deviations.
    """
    points = list(inliers.points)
    for k, group in enumerate(problem.groups):
        measurement = group.measurement
        if not isinstance(measurement, SeenPoints):
            continue
        rest, excluded = measurement.mask_points(points[k]), measurement.seen & ~points[k]
        views = np.flatnonzero(judged_by_view(rest) & excluded.any(1))
        if not len(views):
            continue
        lens, start = state.cameras.get(group.camera), state.camera_from_target(group, problem.stops)[views]
        poses = refine_poses(rest.take(views), start, lens).camera_from_target
        limit = float(scale.limit(np.array(measurement.coordinates)))
        agreement = PointViews(measurement.take(views), lens).agreement(poses, limit)
        points[k] = points[k].copy()
        points[k][views] |= agreement.points
    return replace(inliers, points=tuple(points))


_Fits = Callable[[PointViews, SE3], SE3]


@dataclass(frozen=True, eq=False)
class _Hypotheses:
    """Candidate poses (m, n) of some views of a group, (n,)."""

    views: IntArray
    poses: SE3


def _scale_and_points(problem: Problem, state: State, suspects: list[IntArray]) -> tuple[float, tuple[BoolArray, ...]]:
    """Scale of the points' squared residuals with the lenses of a state, and the inlier points, (n, p), by group.

    Random subsets of points are sampled only for views that the fit to all their points does not explain.
    """
    fits = PointViews.near_fits
    hypotheses = [
        _hypotheses(g, views, problem, state, fits) for g, views in zip(problem.groups, suspects, strict=True)
    ]
    scale, kept = _choose_points(problem, state, hypotheses)
    unclear = [_unclear(g, k, views) for g, k, views in zip(problem.groups, kept, suspects, strict=True)]
    if any(map(len, unclear)):
        for k, group in enumerate(problem.groups):
            clear_views = np.setdiff1d(suspects[k], unclear[k])
            hypotheses[k] = [
                *_hypotheses(group, clear_views, problem, state, fits),
                *_hypotheses(group, unclear[k], problem, state, PointViews.subset_fits),
            ]
        scale, kept = _choose_points(problem, state, hypotheses)
    return scale.variance, kept


def _unclear(group: ViewGroup, inliers: BoolArray, suspects: IntArray) -> IntArray:
    """Suspect views with few points, or with too small a share of inlier points."""
    measurement = group.measurement
    if not isinstance(measurement, SeenPoints):
        return suspects[:0]
    seen = measurement.seen[suspects]
    share = (seen & inliers[suspects]).sum(1) / np.maximum(seen.sum(1), 1)
    unclear: IntArray = suspects[(share < _AGREED) | (seen.shape[1] <= FEW_POINTS)]
    return unclear


def _choose_points(
    problem: Problem, state: State, hypotheses: Sequence[Sequence[_Hypotheses]]
) -> tuple[Scale, tuple[BoolArray, ...]]:
    """Alternate between the scale of squared residuals and the inliers at each view's best pose, until convergence."""
    kept = list(all_inliers(problem).points)
    stated = is_stated(problem)
    # Largest plausible variance of a pixel in units of the variance in use.
    pixel_measurements = [g.measurement for g in problem.groups if isinstance(g.measurement, PixelMeasurement)]
    unit = float(max((m.weight.max(initial=0.0) for m in pixel_measurements), default=1.0)) ** 2 * PLAUSIBLE_PX**2
    scale = Scale(1.0 if stated else unit, np.inf, np.inf, CHANCE_OF_POINT)
    for _ in range(_SCALE_ROUNDS):
        squares = []
        for k, group in enumerate(problem.groups):
            kept[k], group_squares = _agreeing_points(group, hypotheses[k], state, scale)
            squares.append(group_squares)
        previous, scale = scale, robust_scale(squares, 0, stated, CHANCE_OF_POINT)
        if 1 / CONTRADICTED < scale.variance / previous.variance < CONTRADICTED:
            break
    return scale, tuple(kept)


def _hypotheses(
    group: ViewGroup,
    views: IntArray,
    problem: Problem,
    state: State,
    fits: _Fits,
) -> list[_Hypotheses]:
    """Candidate poses of some views; empty without views of points."""
    measurement = group.measurement
    if not len(views) or not isinstance(measurement, SeenPoints):
        return []
    start = state.camera_from_target(group, problem.stops)[views]
    return [_Hypotheses(views, fits(PointViews(measurement.take(views), state.cameras.get(group.camera)), start))]


def _agreeing_points(
    group: ViewGroup, hypotheses: Sequence[_Hypotheses], state: State, scale: Scale
) -> tuple[BoolArray, MahalanobisSquared]:
    """Points that agree with the rest of their view, (n, p), and the squared residuals of all points."""
    measurement = group.measurement
    kept = np.ones((len(group), point_count(measurement)), dtype=bool)
    if not isinstance(measurement, SeenPoints):
        return kept, MahalanobisSquared(np.zeros(0), np.zeros(0, dtype=np.int64))
    limit = float(scale.limit(np.array(measurement.coordinates)))
    squares = [np.zeros(0)]
    for hypothesis in hypotheses:
        sparse_views = measurement.take(hypothesis.views)
        agreement = PointViews(sparse_views, state.cameras.get(group.camera)).largest_agreement(hypothesis.poses, limit)
        kept[hypothesis.views] = agreement.points | ~sparse_views.seen
        # Use all points, not only those within the limit, so that too tight a limit cannot confirm itself.
        squares.append(agreement.squares[sparse_views.seen])
    all_squares = np.concatenate(squares)
    return kept, MahalanobisSquared(all_squares, np.full(len(all_squares), measurement.coordinates))
