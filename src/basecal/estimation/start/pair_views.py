"""Preparation of one camera's views of one target for a start: a subset of them, with directions or poses.

The thresholds are validated by `benchmarks.starts`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from basecal.estimation.problem.view_group import ViewGroup
from basecal.estimation.start.closed_form import Loop, Triple
from basecal.estimation.start.rotation_search import HOPELESS_RAD, rotation_angle
from basecal.estimation.view.bearings import BearingMeasurement
from basecal.estimation.view.measurement import Measurement
from basecal.estimation.view.pixels import PixelMeasurement
from basecal.estimation.view.points import PointMeasurement
from basecal.estimation.view.poses import PoseMeasurement
from basecal.estimation.view.view_pose import FEWEST_3D_POINTS, ViewPoses, view_poses
from basecal.geometry import SE3, Array, BoolArray, Camera, IntArray
from basecal.geometry.rotation import nearest_rotation
from basecal.numerics.batch import choose_entries, take
from basecal.numerics.spectral import dimension, floored_inverse

_AMBIGUOUS_CHI2 = 25.0  # five sigmas: below this difference, the second pose of a plane fits equally well
_AMBIGUOUS_WEIGHT = 0.2  # weight of an ambiguous view
_HALF_WEIGHT_RAD = 0.02  # [rad] sigma of a view's rotation that halves its weight
_FEWEST_POSES = 3  # minimum number of poses: fewer contain less information than all views treated as of an LED
_RIDGE = 1e-9  # [1/m^2, 1/rad^2] information of views without a pose: a small positive weight
_START_SIGMA_PX = 0.5  # [px] sigma of a pixel if it is unstated
_START_SIGMA_RAD = 1e-3  # [rad] sigma of the direction to a 3-D point; assumed: it only weighs directions
_DESCENT_ROUNDS = 20  # most changes of the reading per view; assumed: bounds the time
_LEAST_GAIN_RAD = 1e-6  # [rad] decrease of the summed errors that is not rounding


@dataclass(frozen=True, eq=False)
class PairViews:
    """Subset of the views of one target by one camera.

    Attributes:
        group: The views, with directions or poses as measurements.
        candidates: (n, k) poses of the target in each view, best first; None if views are treated as of an LED.
        weight: (n,) weights of the poses, at most 1.
        total: Number of views before subsampling.
        is_ambiguous: (n,) mask of views whose second pose fits equally well; None if there are none.
    """

    group: ViewGroup
    candidates: SE3 | None
    weight: Array
    total: int
    is_ambiguous: BoolArray | None = None

    def loop(self, x: SE3 | None, y: SE3 | None, z: SE3 | None, choice: IntArray) -> Loop:
        """Factors of the loop, with the candidate of index `choice`, (n,), in each view."""
        rows = np.arange(len(self.group))
        b = SE3.identity((len(rows),)) if self.candidates is None else self.candidates[rows, choice]
        return Loop(self.group.eye.base_from_flange, b, self.group.hand.base_from_flange, x, y, z, self.weight)

    def ambiguous_loop(self, loop: Loop) -> Loop | None:
        """Loop with both poses of each ambiguous view as separate samples; None if no view is ambiguous."""
        if self.candidates is None or self.is_ambiguous is None:
            return None
        row = np.concatenate([np.arange(len(self.group)), np.flatnonzero(self.is_ambiguous)])
        pose = (np.arange(len(row)) >= len(self.group)).astype(np.int64)
        return loop._replace(a=loop.a[row], b=self.candidates[row, pose], c=loop.c[row], weight=self.weight[row])

    def closest_pose(self, triple: Triple) -> IntArray:
        """Index of each view's candidate whose rotation is closest to the prediction of X, Y and Z, (n,)."""
        assert self.candidates is not None
        x, y, z = (transform.rotation for transform in triple)
        group = self.group
        to_target = y @ group.hand.base_from_flange.rotation @ z
        predicted = (group.eye.base_from_flange.rotation @ x).mT @ to_target
        agreement = np.einsum("nij,nkij->nk", predicted, self.candidates.rotation)
        return np.asarray(np.argmax(agreement, axis=-1), dtype=np.int64)


PoseEstimator = Callable[[Array, Array, BoolArray, BearingMeasurement], ViewPoses]


def pair_views(
    group: ViewGroup, camera: Camera | None, views: int, points: int, estimate_poses: PoseEstimator = view_poses
) -> PairViews:
    """Select evenly spaced views of a group and a subset of their points, and estimate the views' poses.

    Args:
        group: The views.
        camera: The lens; None if poses or 3-D points were measured.
        views: Maximum number of views.
        points: Approximate maximum number of points per view.
        estimate_poses: Function that estimates the poses of views, such as a `PoseCache`.
    """
    total = len(group)
    count = min(total, views)
    selected = replace(group, readings=()).take(
        (np.arange(count) * ((total - 1) / max(count - 1, 1))).round().astype(np.int64)
    )
    measurement = selected.measurement
    if isinstance(measurement, PoseMeasurement):
        pose = measurement.measured_camera_from_target
        return PairViews(selected, pose.add_axis()[:, [0, 0]], np.ones(len(selected)), total)
    if isinstance(measurement, PointMeasurement):
        return _point_views(selected, measurement, total)
    assert isinstance(measurement, PixelMeasurement)
    assert camera is not None
    # If views show only parts of the target, such as of a 3-D body, more of its points are retained.
    seen_share = 1.0 if measurement.seen.all() else max(float(np.median(measurement.seen.mean(-1))), 1e-3)
    measurement = measurement.thin(int(np.ceil(points / seen_share)), is_paired=selected.half_turn is not None)
    return _pixel_views(selected, measurement, camera, total, estimate_poses)


def _pixel_views(
    group: ViewGroup, measurement: PixelMeasurement, camera: Camera, total: int, estimate_poses: PoseEstimator
) -> PairViews:
    bearings, valid = camera.undistort(measurement.pixels)
    seen = measurement.seen & valid
    weight = np.where(seen, np.where(measurement.stated > 0, measurement.stated, 1 / _START_SIGMA_PX), 0.0)
    directions = BearingMeasurement(
        measurement.points_in_target, np.where(seen[..., None], bearings, 0.0), weight * float(camera.focal.mean())
    )
    group = replace(group, measurement=directions)
    if len(measurement.points_in_target) < 4:
        return PairViews(group, None, np.ones(len(group)), total)
    poses = estimate_poses(measurement.points_in_target, directions.bearings_in_camera, seen, directions)
    rows = np.flatnonzero(poses.has_pose)
    if len(rows) < min(_FEWEST_POSES, len(group)):
        return PairViews(group, None, np.ones(len(group)), total)
    # With collinear points, the inverse of the sum with a ridge may be singular or indefinite by rounding.
    if len(rows) < len(group):
        group, poses = group.take(rows), take(poses, rows)
    covariance = floored_inverse(poses.information, _RIDGE)
    sigma = np.sqrt(np.trace(covariance[:, 3:, 3:], axis1=-2, axis2=-1))
    is_ambiguous = poses.cost[:, 1] - poses.cost[:, 0] < _AMBIGUOUS_CHI2
    weight = 1 / (1 + sigma / _HALF_WEIGHT_RAD) * np.where(is_ambiguous, _AMBIGUOUS_WEIGHT, 1.0)
    pair = PairViews(group, poses.camera_from_target, weight, total, is_ambiguous if is_ambiguous.any() else None)
    return pair if group.half_turn is None else _with_half_turns(pair, group.half_turn)


def _with_half_turns(pair: PairViews, target_from_turned: SE3) -> PairViews:
    """Choose the half-turn reading of each view that fits the robots' motions; keep the other one's poses, too."""
    assert pair.candidates is not None
    measurement = pair.group.measurement
    assert isinstance(measurement, BearingMeasurement)
    read, reversed_read = pair.candidates, pair.candidates @ target_from_turned
    is_reversed = half_turn_mask(pair.group, read.rotation[:, 0], reversed_read.rotation[:, 0])
    first, second = choose_entries(is_reversed, reversed_read, read), choose_entries(is_reversed, read, reversed_read)
    rotation = np.concatenate([first.rotation, second.rotation], 1)
    candidates = SE3.adopt(rotation, np.concatenate([first.translation, second.translation], 1))
    if not is_reversed.any():
        return replace(pair, candidates=candidates)
    bearings = np.where(
        is_reversed[:, None, None], measurement.bearings_in_camera[:, ::-1], measurement.bearings_in_camera
    )
    weight = np.where(is_reversed[:, None], measurement.weight[:, ::-1], measurement.weight)
    group = replace(pair.group, measurement=replace(measurement, bearings_in_camera=bearings, weight=weight))
    return replace(pair, group=group, candidates=candidates)


def holds_poses(measurement: PointMeasurement) -> bool:
    """Whether enough views of 3-D points determine the pose of the target."""
    count = np.count_nonzero(_whole_views(measurement))
    return bool(count >= _FEWEST_POSES and dimension(measurement.points_in_target) >= 2)


def _whole_views(measurement: PointMeasurement) -> BoolArray:
    return np.asarray(measurement.seen.sum(-1) >= FEWEST_3D_POINTS, dtype=bool)


def _point_views(group: ViewGroup, measurement: PointMeasurement, total: int) -> PairViews:
    if not holds_poses(measurement):
        p = measurement.points_in_camera
        unit = p / np.maximum(np.linalg.norm(p, axis=-1, keepdims=True), 1e-12)
        directions = BearingMeasurement(measurement.points_in_target, unit, measurement.seen / _START_SIGMA_RAD)
        return PairViews(replace(group, measurement=directions), None, np.ones(len(group)), total)
    rows = np.flatnonzero(_whole_views(measurement))
    complete = measurement.take(rows)
    pose = umeyama(complete.points_in_target, complete.points_in_camera, complete.seen.astype(np.float64))
    return PairViews(group.take(rows), pose.add_axis()[:, [0, 0]], np.ones(len(rows)), total)


def umeyama(p_in_a: Array, p_in_b: Array, weight: Array) -> SE3:
    """Least-squares `b_from_a`, (n,), of points (..., p, 3) and (n, p, 3) with weights (n, p).

    Source: Umeyama 1991.
    """
    share = weight / weight.sum(-1, keepdims=True)
    centre_a, centre_b = ((share[:, None] @ points)[:, 0] for points in (p_in_a, p_in_b))
    covariance = np.einsum("np,npi,npj->nij", share, p_in_b - centre_b[:, None], p_in_a - centre_a[:, None])
    rotation = nearest_rotation(covariance)
    return SE3(rotation, centre_b - (rotation @ centre_a[..., None])[..., 0])


def led_point(measurement: Measurement) -> tuple[BearingMeasurement, int]:
    """Return the directions of views, and the index of the point that most views see."""
    assert isinstance(measurement, BearingMeasurement)
    return measurement, int(np.argmax((measurement.weight > 0).sum(0)))


def half_turn_mask(group: ViewGroup, read: Array, reversed_read: Array) -> BoolArray:
    """Mask of views to read with a half turn, (n,), given the target's rotations in both readings, (n, 3, 3) each.

    If only one robot moved between two views, it and the target rotated by the same angle, whatever the mounts are.
    The readings are chosen such that angles agree over all such pairs. Without such pairs, each view has the reading
    with the smaller rotation relative to the first view.
    """
    agreement = np.einsum("nij,ij->n", read, read[0])
    is_reversed = np.einsum("nij,ij->n", reversed_read, read[0]) > agreement
    is_eye_still, is_hand_still = (
        number[:, None] == number[None] for number in (group.eye.stop_number, group.hand.stop_number)
    )
    is_known = np.asarray((is_eye_still != is_hand_still) & ~np.eye(len(group), dtype=bool))
    if not is_known.any():
        return np.asarray(is_reversed)
    eye, hand = group.eye.base_from_flange.rotation, group.hand.base_from_flange.rotation
    eye_angle, hand_angle = (rotation_angle(r[:, None], r) for r in (eye, hand))
    angle = np.where(is_hand_still, eye_angle, hand_angle)
    # Error of the angle between view i in reading s and view j in reading t, (i, s, j, t) [rad].
    readings = np.stack([read, reversed_read], 1)
    between = rotation_angle(readings[:, :, None, None], readings)
    misfit = np.minimum(np.abs(between - angle[:, None, :, None]), HOPELESS_RAD) * is_known[:, None, :, None]
    is_reversed = _descend_readings(misfit, is_reversed.astype(np.int64))
    from_first = _descend_readings(misfit, np.argmin(misfit[:, :, 0, 0], axis=1))
    rows = np.arange(len(is_reversed))
    return min((is_reversed, from_first), key=lambda t: float(misfit[rows, t][:, rows, t].sum())).astype(bool)


def _descend_readings(misfit: Array, reading: Array) -> Array:
    """Coordinate descent on the readings, (n,), until no change of a single view reduces the error."""
    reading, rows = reading.copy(), np.arange(len(reading))
    for _ in range(_DESCENT_ROUNDS * len(reading)):
        misfits = misfit[:, :, rows, reading].sum(-1)
        gain = misfits[rows, reading] - misfits.min(-1)
        best = int(np.argmax(gain))
        if gain[best] < _LEAST_GAIN_RAD:
            break
        reading[best] = 1 - reading[best]
    return reading
