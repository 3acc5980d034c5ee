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
    items = []
    for k, group in enumerate(problem.groups):
        expected = without_errors(problem, state).camera_from_target(group, problem.stops)
        sigmas = np.sqrt(judgement.views[k].value / judgement.view_scale.variance)
        for view in np.flatnonzero(~inliers.views[k]):
            items.append(_left_out_view(group, state, expected, int(view), float(sigmas[view])))
        shape = cell.targets[group.target].target
        if shape is None or not isinstance(group.measurement, SeenPoints):
            continue
        excluded = group.measurement.seen & ~inliers.points[k] & inliers.views[k][:, None]
        rows = np.flatnonzero(excluded.any(-1))
        if len(rows):
            predicted_poses = state.camera_from_target(group, problem.stops)[rows]
            inlier_points, lens = inliers.points[k][rows], state.cameras.get(group.camera)
            distances = _distances(group.measurement.take(rows), inlier_points, predicted_poses, lens)
            ids = _ids_by_view(shape.ids, recorded_problem.groups[k], group)[rows]
            sigma = float(np.sqrt(judgement.point_scale.variance))
            items += _left_out_points(group.take(rows), excluded[rows], ids, distances, sigma)
    return tuple(sorted(items, key=lambda o: (o.sample, o.camera, o.target)))


def _left_out_view(group: ViewGroup, state: State, predicted_pose: SE3, view: int, sigmas: float) -> LeftOut:
    single, predicted = group.take(np.array([view])), predicted_pose[np.array([view])]
    key = int(group.sample[view]), group.camera, group.target
    pose = _single_view_pose(single, state, predicted)
    if pose is None:
        if isinstance(single.measurement, PointMeasurement) and single.measurement.noise_field.endswith("_m"):
            distances_m = lengths(single.measurement.residuals(predicted, None))[single.measurement.seen]
            return LeftOut(*key, (), sigmas, off_m=float(distances_m.max(initial=0.0)))
        if not isinstance(single.measurement, PixelMeasurement):
            return LeftOut(*key, (), sigmas, off_px=np.nan)
        distances_px = np.linalg.norm(single.measurement.residual_px(predicted, state.cameras[single.camera]), axis=-1)
        worst = float(np.nanmax(distances_px)) if np.isfinite(distances_px).any() else np.nan
        return LeftOut(*key, (), sigmas, off_px=worst)
    difference = pose.inverse() @ predicted_pose[view]
    off_m, off_rad = float(np.linalg.norm(difference.translation)), float(np.linalg.norm(difference.rotvec))
    return LeftOut(*key, (), sigmas, off_m, off_rad)


def _single_view_pose(view: ViewGroup, state: State, start: SE3) -> SE3 | None:
    """Pose of the target from a single view; None if it has too few points."""
    measurement = view.measurement
    if isinstance(measurement, PoseMeasurement):
        return measurement.measured_camera_from_target[0]
    fewest = FEWEST_POINTS if isinstance(measurement, PixelMeasurement) else FEWEST_3D_POINTS
    if measurement.point_counts().sum() < fewest:
        return None
    return refine_poses(measurement, start, state.cameras.get(view.camera)).camera_from_target[0]


def _left_out_points(group: ViewGroup, mask: BoolArray, ids: IntArray, distances: Array, sigma: float) -> list[LeftOut]:
    """Describe the points of a mask (n, p), given ids (n, p), distances (n, p) [px or m] and the scale of points."""
    items = []
    assert isinstance(group.measurement, SeenPoints)
    for sample, excluded, view_ids, view_distances, weight in zip(
        group.sample.tolist(), mask, ids, distances, group.measurement.weight, strict=True
    ):
        excluded_distances, sigmas = view_distances[excluded], view_distances[excluded] * weight[excluded] / sigma
        worst = int(np.argmax(sigmas))
        in_pixels = isinstance(group.measurement, PixelMeasurement)
        off_m, off_px = (
            (None, float(excluded_distances[worst])) if in_pixels else (float(excluded_distances[worst]), None)
        )
        excluded_ids = tuple(sorted(view_ids[excluded].tolist()))
        items.append(
            LeftOut(sample, group.camera, group.target, excluded_ids, float(sigmas[worst]), off_m, None, off_px)
        )
    return items


def _ids_by_view(ids: IntArray, recorded_group: ViewGroup, group: ViewGroup) -> IntArray:
    """Ids of each view's points, (n, p); their order is reversed in views whose grid is read with a half turn."""
    recorded, current = recorded_group.measurement, group.measurement
    all_ids = np.broadcast_to(ids, (len(group), len(ids)))
    if (
        group.half_turn is None
        or not isinstance(recorded, PixelMeasurement)
        or not isinstance(current, PixelMeasurement)
    ):
        return all_ids
    as_recorded = np.all(recorded.pixels == current.pixels, axis=(1, 2))
    return np.where(as_recorded[:, None], all_ids, all_ids[:, ::-1])


def _distances(measurement: SeenPoints, mask: BoolArray, predicted_pose: SE3, lens: Camera | None) -> Array:
    """Distances of points from the prediction, (n, p) [px or m]; infinite for points that are not seen.

    The prediction is the pose fitted to the points of each view in the mask, or `predicted_pose` with too few points.
    """
    masked = measurement.mask_points(mask)
    pose = (
        refine_poses(masked, predicted_pose, lens).camera_from_target
        if (masked.equations() >= 6).all()
        else predicted_pose
    )
    rows = point_jacobians(measurement, pose, lens, False)
    weight = np.where(measurement.weight > 0, measurement.weight, 1.0)
    return np.where(rows.seen, np.linalg.norm(rows.residual, axis=-1) / weight, np.inf)
