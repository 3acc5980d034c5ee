"""Items excluded from a solution, and their distance from the prediction of the rest."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from basecal.cell import Cell
from basecal.estimation.noise.robot_noise import without_errors
from basecal.estimation.outliers.classify import Classification
from basecal.estimation.outliers.inlier_mask import InlierMask
from basecal.estimation.problem.problem import Problem, State
from basecal.estimation.problem.view_group import ViewGroup
from basecal.estimation.view.pixels import PixelMeasurement
from basecal.estimation.view.points import PointMeasurement
from basecal.estimation.view.poses import PoseMeasurement
from basecal.estimation.view.target_points import SeenPoints, point_jacobians
from basecal.estimation.view.view_pose import FEWEST_3D_POINTS, FEWEST_POINTS, refine_poses
from basecal.geometry import SE3, Array, BoolArray, Camera, IntArray
from basecal.geometry.rotation import lengths


@dataclass(frozen=True)
class LeftOut:
    """An excluded view, or excluded points of a view, with the deviation from the prediction of the rest.

    Attributes:
        sample: Number of the sample.
        camera: Name of the camera.
        target: Name of the target.
        ids: Ids of the excluded points; empty if the whole view was excluded.
        sigmas: Deviation of the view, or of its worst point, in sigmas; not finite if it is unknown.
        off_m: Distance [m] of views that determine a pose, and of 3-D points; else None.
        off_rad: Angle [rad] of views that determine a pose; else None.
        off_px: Distance [px] of image points; infinite or NaN if the prediction is behind the camera; else None.
    """

    sample: int
    camera: str
    target: str
    ids: tuple[int, ...]
    sigmas: float
    off_m: float | None = None
    off_rad: float | None = None
    off_px: float | None = None


def measure_left_out_items(
    cell: Cell,
    recorded_problem: Problem,
    problem: Problem,
    state: State,
    inliers: InlierMask,
    judgement: Classification,
) -> tuple[LeftOut, ...]:
    """Describe the excluded views and points, sorted by sample.

    Args:
        cell: The cell.
        recorded_problem: The problem as recorded, with the original order of points.
        problem: The same problem with the correspondences that the state predicts.
        state: State of the solution.
        inliers: The inliers.
        judgement: Deviations of all views and points.
    """
    found = []
    for k, group in enumerate(problem.groups):
        expected = without_errors(problem, state).camera_from_target(group, problem.stops)
        sigmas = np.sqrt(judgement.views[k].value / judgement.view_scale.variance)
        for view in np.flatnonzero(~inliers.views[k]):
            found.append(_left_out_view(group, state, expected, int(view), float(sigmas[view])))
        shape = cell.targets[group.target].target
        if shape is None or not isinstance(group.measurement, SeenPoints):
            continue
        lost = group.measurement.seen & ~inliers.points[k] & inliers.views[k][:, None]
        rows = np.flatnonzero(lost.any(-1))
        if len(rows):
            predicted = state.camera_from_target(group, problem.stops)[rows]
            kept, lens = inliers.points[k][rows], state.cameras.get(group.camera)
            distances = _distances(group.measurement.take(rows), kept, predicted, lens)
            ids = _ids_by_view(shape.ids, recorded_problem.groups[k], group)[rows]
            sigma = float(np.sqrt(judgement.point_scale.variance))
            found += _left_out_points(group.take(rows), lost[rows], ids, distances, sigma)
    return tuple(sorted(found, key=lambda o: (o.sample, o.camera, o.target)))


def _left_out_view(group: ViewGroup, state: State, predicted_pose: SE3, view: int, sigmas: float) -> LeftOut:
    one, near = group.take(np.array([view])), predicted_pose[np.array([view])]
    place = int(group.sample[view]), group.camera, group.target
    pose = _single_view_pose(one, state, near)
    if pose is None:
        if isinstance(one.measurement, PointMeasurement) and one.measurement.noise_field.endswith("_m"):
            points_off = lengths(one.measurement.residuals(near, None))[one.measurement.seen]
            return LeftOut(*place, (), sigmas, off_m=float(points_off.max(initial=0.0)))
        if not isinstance(one.measurement, PixelMeasurement):
            return LeftOut(*place, (), sigmas, off_px=np.nan)
        pixels_off = np.linalg.norm(one.measurement.residual_px(near, state.cameras[one.camera]), axis=-1)
        worst = float(np.nanmax(pixels_off)) if np.isfinite(pixels_off).any() else np.nan
        return LeftOut(*place, (), sigmas, off_px=worst)
    off = pose.inverse() @ predicted_pose[view]
    off_m, off_rad = float(np.linalg.norm(off.translation)), float(np.linalg.norm(off.rotvec))
    return LeftOut(*place, (), sigmas, off_m, off_rad)


def _single_view_pose(one: ViewGroup, state: State, start: SE3) -> SE3 | None:
    """Pose of the target from a single view; None if it has too few points."""
    measurement = one.measurement
    if isinstance(measurement, PoseMeasurement):
        return measurement.measured_camera_from_target[0]
    fewest = FEWEST_POINTS if isinstance(measurement, PixelMeasurement) else FEWEST_3D_POINTS
    if measurement.point_counts().sum() < fewest:
        return None
    return refine_poses(measurement, start, state.cameras.get(one.camera)).camera_from_target[0]


def _left_out_points(group: ViewGroup, mask: BoolArray, ids: IntArray, distances: Array, sigma: float) -> list[LeftOut]:
    """Describe the points of a mask (n, p), given ids (n, p), distances (n, p) [px or m] and the scale of points."""
    found = []
    assert isinstance(group.measurement, SeenPoints)
    for sample, mine, numbers, away, weight in zip(
        group.sample.tolist(), mask, ids, distances, group.measurement.weight, strict=True
    ):
        off, sigmas = away[mine], away[mine] * weight[mine] / sigma
        worst = int(np.argmax(sigmas))
        in_pixels = isinstance(group.measurement, PixelMeasurement)
        off_m, off_px = (None, float(off[worst])) if in_pixels else (float(off[worst]), None)
        which = tuple(sorted(numbers[mine].tolist()))
        found.append(LeftOut(sample, group.camera, group.target, which, float(sigmas[worst]), off_m, None, off_px))
    return found


def _ids_by_view(ids: IntArray, recorded_group: ViewGroup, group: ViewGroup) -> IntArray:
    """Ids of each view's points, (n, p); their order is reversed in views whose grid is read with a half turn."""
    first, now = recorded_group.measurement, group.measurement
    every = np.broadcast_to(ids, (len(group), len(ids)))
    if group.half_turn is None or not isinstance(first, PixelMeasurement) or not isinstance(now, PixelMeasurement):
        return every
    as_recorded = np.all(first.pixels == now.pixels, axis=(1, 2))
    return np.where(as_recorded[:, None], every, every[:, ::-1])


def _distances(measurement: SeenPoints, mask: BoolArray, predicted_pose: SE3, lens: Camera | None) -> Array:
    """Distances of points from the prediction, (n, p) [px or m]; infinite for points that are not seen.

    The prediction is the pose fitted to the points of each view in the mask, or `predicted_pose` with too few points.
    """
    left = measurement.mask_points(mask)
    pose = (
        refine_poses(left, predicted_pose, lens).camera_from_target if (left.equations() >= 6).all() else predicted_pose
    )
    rows = point_jacobians(measurement, pose, lens, False)
    weight = np.where(measurement.weight > 0, measurement.weight, 1.0)
    return np.where(rows.seen, np.linalg.norm(rows.residual, axis=-1) / weight, np.inf)
