"""Inliers of a problem at a state: each view, shared stop and point is compared to the prediction of all others.

The thresholds are validated by `benchmarks.outliers`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from basecal.estimation.least_squares.studentized_residuals import (
    LeaveOneOut,
    MahalanobisSquared,
    judged_by_view,
    leave_one_out,
    studentized_points,
    studentized_stops,
    studentized_views,
)
from basecal.estimation.noise.estimate import residual_counts
from basecal.estimation.outliers.inlier_mask import InlierMask, without_points
from basecal.estimation.outliers.robust_scale import Scale, robust_scale
from basecal.estimation.outliers.view_ransac import PointViews, Prior, RansacViews
from basecal.estimation.problem.problem import Problem, State
from basecal.estimation.problem.view_group import ViewGroup
from basecal.estimation.view.target_points import SeenPoints
from basecal.estimation.view.view_pose import refine_poses
from basecal.geometry import BoolArray, Camera, IntArray
from basecal.numerics.batch import take

CHANCE_OF_VIEW = 1e-4  # false alarm rate of a view: one per hundred recordings of a hundred views
CHANCE_OF_POINT = 1e-6  # false alarm rate of a point: there are a hundred times as many points
_CHANCE_AMONG_OUTLIERS = 1e-3  # false alarm rate of a view if outliers are common: small outliers are likely, too
_MANY_OUT = 0.1  # share of outlying views beyond which outliers are common
_LEAST_SHARE = 0.5  # minimum share of inlier points of a view; with fewer the whole view is an outlier
_LEAST_STRAYED = 0.25  # minimum share of points at the predicted pose, unless all points agree on another pose
_EXACT = 1e-14  # variance of a pose's rounding [m^2, rad^2]


@dataclass(frozen=True, eq=False)
class Classification:
    """Inliers of a problem, and the deviations and scales that they follow from.

    Attributes:
        kept: The inliers.
        views: Squared deviation of each view from the other inliers, (n,), by group.
        points: Squared deviation of each point, (n, p), by group; NaN for points that were outliers before.
        stops: Squared deviation of each shared stop, (k,).
        view_scale: Scale of the views' squared deviations.
        point_scale: Scale of the squared deviations of points that are judged by the rest of their view.
    """

    kept: InlierMask
    views: tuple[MahalanobisSquared, ...]
    points: tuple[MahalanobisSquared, ...]
    stops: MahalanobisSquared
    view_scale: Scale
    point_scale: Scale


def is_stated(problem: Problem) -> bool:
    """Whether every residual's sigma was stated."""
    return all(field == "stated" or not count for field, count in residual_counts(problem).items())


def view_scale(problem: Problem, squares: Sequence[MahalanobisSquared], chance: float = CHANCE_OF_VIEW) -> Scale:
    """Scale of the views' squared deviations."""
    return robust_scale(list(squares), problem.width, is_stated(problem), chance)


def classify_inliers(problem: Problem, state: State, inliers: InlierMask) -> Classification:
    """Classify the views, stops and points of a problem at a state.

    Args:
        problem: The problem with all views and points.
        state: The state.
        inliers: The inliers that the state was fitted to.
    """
    linearisation = leave_one_out(without_points(problem, inliers.points), state, inliers.weights)
    views, stops = studentized_views(linearisation), studentized_stops(linearisation)
    points = studentized_points(linearisation)
    # A higher false alarm rate is accepted if outliers are common: a large deviation is then more likely an outlier.
    was_inlier = np.concatenate(inliers.views)
    chance = _CHANCE_AMONG_OUTLIERS if len(was_inlier) and was_inlier.mean() < 1 - _MANY_OUT else CHANCE_OF_VIEW
    scale = view_scale(problem, [take(s, v) for s, v in zip(views, inliers.views, strict=True)], chance)
    is_judged_by_view = [judged_by_view(g.measurement) for g in linearisation.problem.groups]
    scale_by_view = _point_scale(problem, points, inliers, is_judged_by_view)
    scale_by_state = _point_scale(problem, points, inliers, [~o for o in is_judged_by_view])
    is_bad_stop = scale.gross_mask(stops)
    use_views, use_points = [], []
    for k, group in enumerate(linearisation.problem.groups):
        is_gross = np.where(
            is_judged_by_view[k][:, None], scale_by_view.gross_mask(points[k]), scale_by_state.gross_mask(points[k])
        )
        is_stray = is_gross & is_judged_by_view[k][:, None]
        is_used = ~scale.gross_mask(views[k]) & ~_stop_mask(group, is_bad_stop) & ~(is_gross & ~is_stray).any(1)
        use_views.append(is_used & _has_enough(problem.groups[k], inliers.points[k] & ~is_stray))
        use_points.append(inliers.points[k] & ~is_stray)
    readmitted = _readmit(
        linearisation, problem, InlierMask(tuple(use_views), tuple(use_points)), scale, scale_by_view, is_bad_stop
    )
    return Classification(readmitted, views, points, stops, scale, scale_by_view)


def _point_scale(
    problem: Problem, points: Sequence[MahalanobisSquared], inliers: InlierMask, masks: list[BoolArray]
) -> Scale:
    rows = [mask & used for mask, used in zip(masks, inliers.views, strict=True)]
    squares = [take(square, row) for square, row in zip(points, rows, strict=True)]
    return robust_scale(squares, 0, is_stated(problem), CHANCE_OF_POINT)


def _stop_mask(group: ViewGroup, is_bad_stop: BoolArray) -> BoolArray:
    """Mask of the views at a bad stop, (n,)."""
    mask = np.zeros(len(group), dtype=bool)
    for stop in (end.stop for end in group.ends):
        mask |= (stop >= 0) & (is_bad_stop[stop] if len(is_bad_stop) else False)
    return mask


def _has_enough(group: ViewGroup, points: BoolArray) -> BoolArray:
    """Whether enough points of each view remain, (n,), for a mask of inlier points (n, p)."""
    if not isinstance(group.measurement, SeenPoints):
        return np.ones(len(group), dtype=bool)
    seen = group.measurement.seen
    enough: BoolArray = (seen & points).sum(1) >= _LEAST_SHARE * seen.sum(1)
    return enough & (seen & points).any(1)


def _readmit(
    linearisation: LeaveOneOut,
    problem: Problem,
    inliers: InlierMask,
    scale: Scale,
    point_scale: Scale,
    is_bad_stop: BoolArray,
) -> InlierMask:
    """Readmit outlying views with few points if most of their points agree with the prediction of all other views."""
    views, points = list(inliers.views), list(inliers.points)
    for k, group in enumerate(problem.groups):
        measurement = group.measurement
        if not isinstance(measurement, SeenPoints) or measurement.seen.shape[1] < 2:
            continue
        rows = np.flatnonzero(~inliers.views[k] & ~judged_by_view(measurement) & ~_stop_mask(group, is_bad_stop))
        if not len(rows):
            continue
        prior = _prior(linearisation, k, rows, scale.variance)
        sparse_views = measurement.take(rows)
        camera = linearisation.state.cameras.get(group.camera)
        limit = float(point_scale.limit(np.array(measurement.coordinates)))
        point_views = PointViews(sparse_views, camera, prior)
        agreement = point_views.largest_agreement(point_views.subset_fits(prior.camera_from_target), limit)
        tension = prior.tension(agreement.camera_from_target)[0] * scale.variance
        inlier_counts, seen_counts = agreement.points.sum(1), sparse_views.seen.sum(1)
        has_strays = (
            (inlier_counts >= _LEAST_STRAYED * seen_counts)
            & (inlier_counts > 1)
            & ~_agrees_with_itself(sparse_views, agreement, camera, limit)
        )
        is_readmitted = (tension <= scale.limit(np.array(6))) & (
            (inlier_counts >= _LEAST_SHARE * seen_counts) | has_strays
        )
        views[k] = views[k].copy()
        views[k][rows] = is_readmitted
        points[k] = points[k].copy()
        points[k][rows] = np.where(is_readmitted[:, None], agreement.points | ~sparse_views.seen, points[k][rows])
    return InlierMask(tuple(views), tuple(points))


def _agrees_with_itself(
    sparse_views: SeenPoints, agreement: RansacViews, camera: Camera | None, limit: float
) -> BoolArray:
    """Whether all points of each view agree on one pose, (n,): the error is then of the view, not of points."""
    poses = refine_poses(sparse_views, agreement.camera_from_target, camera).camera_from_target
    self_agreement = PointViews(sparse_views, camera).agreement(poses, limit)
    return np.asarray(self_agreement.points.sum(1) == sparse_views.seen.sum(1))


def _prior(linearisation: LeaveOneOut, k: int, rows: IntArray, variance: float) -> Prior:
    """Predicted poses of views that are not part of the fit, with unknown errors of their private stops."""
    view, group = linearisation.normal.views[k], linearisation.problem.groups[k]
    spread = linearisation.spread[k].copy()
    errors = linearisation.state.stop_errors.copy()
    for part in view.private:
        spread[part.view] += part.by_error @ part.by_error.mT
        errors[part.stop] = 0.0
    camera_from_target = replace(linearisation.state, stop_errors=errors).camera_from_target(
        group, linearisation.problem.stops
    )
    pose_spread = spread[rows][:, :6, :6] * variance + _EXACT * np.eye(6)
    return Prior(camera_from_target[rows], np.asarray(np.linalg.inv(pose_spread), dtype=np.float64))
