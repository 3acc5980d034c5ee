"""Errors of views against their predictions, and motion of views, in one measure for all kinds of measurement."""

from __future__ import annotations

import numpy as np

from basecal.errors import InputError
from basecal.estimation.noise.robot_noise import without_errors
from basecal.estimation.problem.problem import Problem, State
from basecal.estimation.problem.view_group import ViewGroup
from basecal.estimation.view.pixels import PixelMeasurement
from basecal.estimation.view.points import PointMeasurement
from basecal.estimation.view.poses import PoseMeasurement
from basecal.geometry import SE3, Array, BoolArray
from basecal.geometry.rotation import lengths, nearest_rotation

# [rad/px] of a typical lens with a focal length of 1000 px, to make errors in pixels and angles comparable; assumed.
PIXEL_SCALE = 1e-3
_SHORTEST_M = 1e-12  # [m] smallest distance to a target, to avoid a division by zero


def view_errors(problem: Problem, group: ViewGroup, state: State) -> Array:
    """Error of each view of a group under a state, with robots as recorded, (n,); see `HypothesisFit.errors`."""
    predicted = without_errors(problem, state).camera_from_target(group, problem.stops)
    measurement = group.measurement
    if isinstance(measurement, PoseMeasurement):
        return _pose_errors(measurement.measured_camera_from_target, predicted)
    if isinstance(measurement, PointMeasurement):
        return _rms(measurement.residuals(predicted, None), measurement.seen) / group.reach_m
    if not isinstance(measurement, PixelMeasurement):
        raise InputError(f"views of {group.target} are {type(measurement).__name__}s, expected pixels, poses or points")
    off = np.nan_to_num(measurement.residual_px(predicted, state.cameras[group.camera]), nan=np.inf)
    return PIXEL_SCALE * _rms(off, measurement.seen)


def view_deviations(group: ViewGroup) -> Array:
    """Deviation of each view from the median view, independent of the robot poses, (n,); see `view_errors`."""
    measurement = group.measurement
    if isinstance(measurement, PoseMeasurement):
        seen = measurement.measured_camera_from_target
        return _pose_errors(seen, SE3(nearest_rotation(seen.rotation.sum(0)), np.median(seen.translation, axis=0)))
    if isinstance(measurement, PointMeasurement):
        deviations = _subtract_median(measurement.points_in_camera, measurement.seen)
        return _rms(deviations, measurement.seen) / group.reach_m
    if isinstance(measurement, PixelMeasurement):
        return PIXEL_SCALE * _rms(_subtract_median(measurement.pixels, measurement.seen), measurement.seen)
    raise InputError(f"views are {type(measurement).__name__}s, expected pixels, poses or points")


def _subtract_median(values: Array, is_visible: BoolArray) -> Array:
    """Subtract from each point its median over the views that see it, (n, m, k)."""
    visible = np.where(is_visible[..., None], values, np.nan)
    is_seen = is_visible.any(0)
    median = np.zeros(values.shape[1:])
    median[is_seen] = np.nanmedian(visible[:, is_seen], axis=0)
    deviations: Array = values - median
    return deviations


def _pose_errors(measured_pose: SE3, predicted_pose: SE3) -> Array:
    """RMS over the six coordinates of each pose error, (n,): of the rotation, and the length over the distance."""
    off = measured_pose.inverse() @ predicted_pose
    distance = max(float(np.median(lengths(measured_pose.translation))), _SHORTEST_M)
    rms: Array = np.hypot(lengths(off.rotvec), lengths(off.translation) / distance) / np.sqrt(6)
    return rms


def _rms(errors: Array, is_visible: BoolArray) -> Array:
    """RMS over the coordinates of the points that each view sees, (n,)."""
    squares = np.where(is_visible[..., None], errors, 0.0) ** 2
    count = errors.shape[2] * np.maximum(is_visible.sum(1), 1)
    rms: Array = np.sqrt(squares.sum((1, 2)) / count)
    return rms
