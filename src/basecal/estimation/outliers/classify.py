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
    about = leave_one_out(without_points(problem, inliers.points), state, inliers.weights)
    views, stops, points = studentized_views(about), studentized_stops(about), studentized_points(about)
    # A higher false alarm rate is accepted if outliers are common: a large deviation is then more likely an outlier.
    before = np.concatenate(inliers.views)
    chance = _CHANCE_AMONG_OUTLIERS if len(before) and before.mean() < 1 - _MANY_OUT else CHANCE_OF_VIEW
    scale = view_scale(problem, [take(s, v) for s, v in zip(views, inliers.views, strict=True)], chance)
    own = [judged_by_view(g.measurement) for g in about.problem.groups]
    by_view = _point_scale(problem, points, inliers, own)
    by_state = _point_scale(problem, points, inliers, [~o for o in own])
    bad_stop = scale.gross_mask(stops)
    use_views, use_points = [], []
    for k, group in enumerate(about.problem.groups):
        bad = np.where(own[k][:, None], by_view.gross_mask(points[k]), by_state.gross_mask(points[k]))
        stray = bad & own[k][:, None]
        used = ~scale.gross_mask(views[k]) & ~_stop_mask(group, bad_stop) & ~(bad & ~stray).any(1)
        use_views.append(used & _has_enough(problem.groups[k], inliers.points[k] & ~stray))
        use_points.append(inliers.points[k] & ~stray)
    now = _readmit(about, problem, InlierMask(tuple(use_views), tuple(use_points)), scale, by_view, bad_stop)
    return Classification(now, views, points, stops, scale, by_view)


def _point_scale(
    problem: Problem, points: Sequence[MahalanobisSquared], inliers: InlierMask, masks: list[BoolArray]
) -> Scale:
    rows = [w & v for w, v in zip(masks, inliers.views, strict=True)]
    squares = [take(s, r) for s, r in zip(points, rows, strict=True)]
    return robust_scale(squares, 0, is_stated(problem), CHANCE_OF_POINT)


def _stop_mask(group: ViewGroup, bad: BoolArray) -> BoolArray:
    """Mask of the views at a bad stop, (n,)."""
    out = np.zeros(len(group), dtype=bool)
    for stop in (end.stop for end in group.ends):
        out |= (stop >= 0) & (bad[stop] if len(bad) else False)
    return out


def _has_enough(group: ViewGroup, points: BoolArray) -> BoolArray:
    """Whether enough points of each view remain, (n,), for a mask of inlier points (n, p)."""
    if not isinstance(group.measurement, SeenPoints):
        return np.ones(len(group), dtype=bool)
    seen = group.measurement.seen
    left: BoolArray = (seen & points).sum(1) >= _LEAST_SHARE * seen.sum(1)
    return left & (seen & points).any(1)


def _readmit(
    model: LeaveOneOut, problem: Problem, inliers: InlierMask, scale: Scale, of_points: Scale, bad_stop: BoolArray
) -> InlierMask:
    """Readmit outlying views with few points if most of their points agree with the prediction of all other views."""
    views, points = list(inliers.views), list(inliers.points)
    for k, group in enumerate(problem.groups):
        measurement = group.measurement
        if not isinstance(measurement, SeenPoints) or measurement.seen.shape[1] < 2:
            continue
        some = np.flatnonzero(~inliers.views[k] & ~judged_by_view(measurement) & ~_stop_mask(group, bad_stop))
        if not len(some):
            continue
        prior = _prior(model, k, some, scale.variance)
        few = measurement.take(some)
        camera = model.state.cameras.get(group.camera)
        limit = float(of_points.limit(np.array(measurement.coordinates)))
        of_few = PointViews(few, camera, prior)
        found = of_few.largest_agreement(of_few.subset_fits(prior.camera_from_target), limit)
        tension = prior.tension(found.camera_from_target)[0] * scale.variance
        left, all_points = found.points.sum(1), few.seen.sum(1)
        strays = (left >= _LEAST_STRAYED * all_points) & (left > 1) & ~_agrees_with_itself(few, found, camera, limit)
        agrees = (tension <= scale.limit(np.array(6))) & ((left >= _LEAST_SHARE * all_points) | strays)
        views[k] = views[k].copy()
        views[k][some] = agrees
        points[k] = points[k].copy()
        points[k][some] = np.where(agrees[:, None], found.points | ~few.seen, points[k][some])
    return InlierMask(tuple(views), tuple(points))


def _agrees_with_itself(
    sparse_views: SeenPoints, agreement: RansacViews, camera: Camera | None, limit: float
) -> BoolArray:
    """Whether all points of each view agree on one pose, (n,): the error is then of the view, not of points."""
    poses = refine_poses(sparse_views, agreement.camera_from_target, camera).camera_from_target
    alone = PointViews(sparse_views, camera).agreement(poses, limit)
    return np.asarray(alone.points.sum(1) == sparse_views.seen.sum(1))


def _prior(model: LeaveOneOut, k: int, rows: IntArray, variance: float) -> Prior:
    """Predicted poses of views that are not part of the fit, with unknown errors of their private stops."""
    of, group = model.normal.views[k], model.problem.groups[k]
    spread = model.spread[k].copy()
    errors = model.state.stop_errors.copy()
    for part in of.private:
        spread[part.view] += part.by_error @ part.by_error.mT
        errors[part.stop] = 0.0
    predicted = replace(model.state, stop_errors=errors).camera_from_target(group, model.problem.stops)
    pose_spread = spread[rows][:, :6, :6] * variance + _EXACT * np.eye(6)
    return Prior(predicted[rows], np.asarray(np.linalg.inv(pose_spread), dtype=np.float64))
