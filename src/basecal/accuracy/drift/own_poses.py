"""Views linearised about the pose that they show themselves, if they are far from where a calibration predicts them.

The first order of a view is not valid about a prediction that is far off. Points that the prediction has outside the
lens hold no information. A view's own pose has all of it. The tangent from the prediction to that pose is linear in the
shift of one frame, however large the shift is.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from basecal.estimation.view.bearings import BearingMeasurement
from basecal.estimation.view.measurement import ViewInformation
from basecal.estimation.view.pixels import PixelMeasurement
from basecal.estimation.view.view_pose import FEWEST_POINTS, refine_poses, view_poses
from basecal.geometry import SE3, Array, BoolArray, Camera, IntArray
from basecal.geometry.se3_jacobians import right_jacobian
from basecal.numerics.batch import concatenate
from basecal.numerics.spectral import VIEW_ROUNDING, spectrum

_SAME_CHI2 = 25.0  # five sigmas, a chance of 6e-7: less is what the second order of noise may cost


class ViewTangents(NamedTuple):
    """The tangent from predicted to seen `camera_from_target`, (n, 6), and its information, (n, 6, 6)."""

    tangent: Array
    information: Array


def first_order(linear: ViewInformation) -> ViewTangents:
    """The tangent to the optimum of views, by their linearisation."""
    step = spectrum(linear.information, VIEW_ROUNDING).inverse @ linear.gradient[..., None]
    return ViewTangents(-step[..., 0], linear.information)


def view_tangents(measurement: PixelMeasurement, prediction: SE3, camera: Camera) -> ViewTangents:
    """How far views are off their prediction: to first order if that is valid, else by their own poses.

    Args:
        measurement: n views.
        prediction: (n,) `camera_from_target`.
        camera: The lens.
    """
    linear = measurement.linearise(prediction, camera, False)
    near = first_order(linear)
    rows = np.flatnonzero(~_is_first_order(measurement, prediction, camera, near) | ~np.isfinite(linear.cost))
    if not len(rows):
        return near
    tangent, information = near.tangent.copy(), near.information.copy()
    tangent[rows], information[rows] = _far_tangents(measurement.take(rows), prediction[rows], camera)
    return ViewTangents(tangent, information)


def _is_first_order(measurement: PixelMeasurement, prediction: SE3, camera: Camera, linear: ViewTangents) -> BoolArray:
    """Whether the first order reaches a view's optimum."""
    reached = measurement.linearise(prediction @ SE3.exp(linear.tangent), camera, False)
    gain = -np.sum(first_order(reached).tangent * reached.gradient, axis=-1)
    return np.asarray(np.isfinite(reached.cost) & (gain < _SAME_CHI2))


def _far_tangents(measurement: PixelMeasurement, prediction: SE3, camera: Camera) -> ViewTangents:
    """Tangents to the views' own poses; by directions of points about the prediction if these hold no pose."""
    chords = _bearings(measurement, camera)
    coarse = first_order(chords.linearise(prediction, None, False))
    if len(measurement.points_in_target) < FEWEST_POINTS:
        return coarse
    own = _own_poses(measurement, chords, prediction, camera)
    tangent = (prediction.inverse() @ own.camera_from_target).log()
    transport = right_jacobian(tangent)  # the own pose errs in its own axes
    return ViewTangents(
        np.where(own.has_pose[:, None], tangent, coarse.tangent),
        np.where(own.has_pose[:, None, None], transport.mT @ own.information @ transport, coarse.information),
    )


class _OwnPoses(NamedTuple):
    camera_from_target: SE3
    information: Array
    has_pose: BoolArray


def _own_poses(measurement: PixelMeasurement, chords: BearingMeasurement, prediction: SE3, camera: Camera) -> _OwnPoses:
    """The pose that fits each view best, from its prediction and from its closed forms, (n,)."""
    closed = view_poses(measurement.points_in_target, chords.bearings_in_camera, chords.weight > 0, chords)
    starts = [prediction, closed.camera_from_target[:, 0], closed.camera_from_target[:, 1]]
    ends = [refine_poses(measurement, start, camera) for start in starts]
    cost = np.stack([np.nan_to_num(end.cost, nan=np.inf, posinf=np.inf) for end in ends])
    choice = np.argmin(cost, axis=0)
    rows: IntArray = choice * len(prediction) + np.arange(len(prediction))
    poses = concatenate([end.camera_from_target for end in ends])[rows]
    information = np.concatenate([end.information for end in ends])[rows]
    return _OwnPoses(poses, information, closed.has_pose & np.isfinite(cost.min(0)))


def _bearings(measurement: PixelMeasurement, camera: Camera) -> BearingMeasurement:
    """The directions of seen points, with the sigmas of their pixels."""
    bearings, valid = camera.undistort(measurement.pixels)
    weight = np.where(measurement.seen & valid, measurement.weight, 0.0) * float(camera.focal.mean())
    return BearingMeasurement(measurement.points_in_target, np.where(valid[..., None], bearings, 0.0), weight)
