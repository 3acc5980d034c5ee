"""Innovations: deviations of new views from their predictions by a calibration, with their covariance.

Each view determines the tangent of its `camera_from_target` with the information H = S S'. S' times the tangent has one
entry of unit variance for each column of S. Predictions have the covariance of the calibration and of the robots'
errors. Views of one stop share a robot error; errors that the calibration found to be shared are correlated between
stops. Source: docs/mathematics.md (13.1).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from basecal.accuracy.residuals.evaluation import known_views
from basecal.accuracy.systematic_errors.situation import Situation
from basecal.cell import Calibration, Cell, Recording
from basecal.effects import smooth
from basecal.effects.faces.effect import RandomEffect
from basecal.effects.faces.robot_parameter import Posture
from basecal.effects.registry import RANDOM_EFFECTS
from basecal.estimation.noise.robot_noise import without_errors
from basecal.estimation.problem.build import recorded_by_joints
from basecal.estimation.problem.correspondence import choose_correspondence
from basecal.estimation.problem.problem import Stops
from basecal.estimation.problem.view_group import ViewGroup
from basecal.estimation.view.bearings import BearingMeasurement
from basecal.estimation.view.measurement import ViewInformation
from basecal.estimation.view.pixels import PixelMeasurement
from basecal.estimation.view.target_points import require_camera
from basecal.estimation.view.view_pose import FEWEST_POINTS, refine_poses, view_poses
from basecal.geometry import SE3, Array, BoolArray, Camera, IntArray
from basecal.geometry.se3_jacobians import right_jacobian
from basecal.numerics.batch import concatenate
from basecal.numerics.spectral import VIEW_ROUNDING, spectrum

MOST_VIEWS = 300  # largest number of compared views, evenly chosen: their covariance has six rows for each view


@dataclass(frozen=True, eq=False)
class Innovations:
    """Deviations of n new views from their predictions by a calibration, with the views of all groups in sequence.

    Attributes:
        situation: The problem at the calibration's transforms.
        root: (n, 6, 6) S of each view's information S S'.
        deviation: (6 n,) S' times the tangent from each view's prediction to the view. The views' noise has unit
            variance.
        predicted: (6 n, 6 n) covariance of `deviation` from the uncertainty of the predictions.
        sample: (n,) sample number of each view.
        known_inverse: The value of `covariance_inverse`, if it is already known.
        noise_freedoms: Degrees of freedom of the calibration's estimated noise; infinite if it was stated.
    """

    situation: Situation
    root: Array
    deviation: Array
    predicted: Array
    sample: IntArray
    known_inverse: Array | None = None
    noise_freedoms: float = np.inf

    @cached_property
    def covariance_inverse(self) -> Array:
        """(6 n, 6 n) inverse of the covariance of `deviation`."""
        if self.known_inverse is not None:
            return self.known_inverse
        return np.asarray(np.linalg.inv(np.eye(len(self.deviation)) + self.predicted), dtype=np.float64)

    def whiten(self, tangents: Array) -> Array:
        """Multiply tangents of the views, (n, 6, k), by S' as in `deviation`, (6 n, k)."""
        return (self.root.mT @ tangents).reshape(len(self.deviation), tangents.shape[-1])

    @property
    def robots(self) -> tuple[str, ...]:
        """Names of the robots that carry the cameras and targets of the views."""
        return self.situation.problem.robots

    def frame_jacobian(self, name: str) -> Array:
        """Derivative of the views with respect to a right tangent of a transform, (n, 6, 6)."""
        parts = [self.situation.frame_jacobian(k, name) for k in range(len(self.situation.problem.groups))]
        return np.concatenate([np.zeros((0, 6, 6)), *parts])

    def flange_jacobian(self, robot: str) -> Array:
        """Derivative of the views with respect to a right tangent of a robot's flange, (n, 6, 6)."""
        parts = [self.situation.flange_jacobian(k, robot) for k in range(len(self.situation.problem.groups))]
        return np.concatenate([np.zeros((0, 6, 6)), *parts])

    def joint_jacobian(self, robot: str) -> Array:
        """Derivative of the views with respect to a robot's joints, (n, 6, joints); (n, 6, 0) if joints are missing."""
        posture = self.posture(robot)
        if posture is None:
            return np.zeros((len(self.sample), 6, 0))
        return self.flange_jacobian(robot) @ posture.true.joint_derivative

    def posture(self, robot: str) -> Posture | None:
        """Posture of a robot with its stated kinematics in all views; None if its joints were not recorded.

        Joints are zero in views without the robot.
        """
        chain = self.situation.problem.chains.get(robot)
        groups = self.situation.problem.groups
        if chain is None or not recorded_by_joints(self.situation.problem, robot):
            return None
        ends = [group.robot_end(robot) for group in groups]
        joints = [None if end is None else end.joints for end in ends]
        filled = [np.zeros((len(g), chain.n)) if q is None else q for g, q in zip(groups, joints, strict=True)]
        return Posture(chain, recorded := np.concatenate(filled), chain.posture(recorded))

    def recorded_stops(self, robot: str) -> tuple[SE3, IntArray]:
        """Recorded poses of a robot's flange in all views, (n,), and its stop numbers, (n,), -1 in views without it."""
        groups = self.situation.problem.groups
        poses = [self.situation.recorded_pose(k, robot) for k in range(len(groups))]
        ends = [(group, group.robot_end(robot)) for group in groups]
        stops = [np.full(len(group), -1) if end is None else end.stop_number for group, end in ends]
        return concatenate(poses), np.concatenate(stops)

    def drop_sample(self, sample: int) -> Innovations:
        """Return a copy without the views of a sample."""
        kept = self.sample != sample
        rows = np.repeat(kept, 6)
        groups, first = [], 0
        for group in self.situation.problem.groups:
            groups.append(group.take(np.flatnonzero(kept[first : first + len(group)])))
            first += len(group)
        situation = replace(self.situation, problem=self.situation.problem.with_groups(groups))
        predicted = self.predicted[np.ix_(rows, rows)]
        # The inverse of a submatrix from the inverse of the whole: less work if few rows are left out.
        whole = self.covariance_inverse
        across = whole[np.ix_(rows, ~rows)]
        inverse = whole[np.ix_(rows, rows)] - across @ np.linalg.solve(whole[np.ix_(~rows, ~rows)], across.T)
        return replace(
            self,
            situation=situation,
            root=self.root[kept],
            deviation=self.deviation[rows],
            predicted=predicted,
            sample=self.sample[kept],
            known_inverse=inverse,
        )


def innovations(cell: Cell, calibration: Calibration, recording: Recording) -> Innovations:
    """Compute the innovations of new samples; views with a transform unknown to the calibration are left out.

    Args:
        cell: The calibrated cell.
        calibration: Its calibration.
        recording: The new samples.

    Raises:
        InputError: if the cell contradicts the recording.
    """
    situation = _situation(cell, calibration, recording)
    groups = situation.problem.groups
    root, deviation = [np.zeros((0, 6, 6))], [np.zeros((0, 6))]
    for group in groups:
        views = _tangents(group, situation)
        root.append(spectrum(views.information, VIEW_ROUNDING).root)
        deviation.append((root[-1].mT @ views.tangent[..., None])[..., 0])
    sample = np.concatenate([np.zeros(0, dtype=np.int64), *(group.sample for group in groups)])
    flat = np.concatenate(deviation).ravel()
    exact = Innovations(situation, np.concatenate(root), flat, np.zeros((len(flat), len(flat))), sample)
    predicted = _robot_covariance(exact, calibration)
    if calibration.joint_covariance is not None and calibration.order:
        by_transforms = np.concatenate([exact.whiten(exact.frame_jacobian(name)) for name in calibration.order], axis=1)
        known = calibration.joint_covariance - sum(gauge.covariance for gauge in calibration.gauges)
        predicted = by_transforms @ known @ by_transforms.T + predicted
    robots = calibration.noise.get("robots", {})
    freedoms = min((robots.get(robot, {}).get("freedoms") or np.inf for robot in exact.robots), default=np.inf)
    return replace(exact, predicted=predicted, noise_freedoms=float(freedoms))


def _tangents(group: ViewGroup, situation: Situation) -> ViewTangents:
    """Tangents from the predictions of a group's views to the views."""
    state = situation.state
    predicted, camera = state.camera_from_target(group, situation.problem.stops), state.cameras.get(group.camera)
    if isinstance(group.measurement, PixelMeasurement):
        return view_tangents(group.measurement, predicted, require_camera(camera))
    return first_order_tangents(group.measurement.linearise(predicted, camera, False))


def _situation(cell: Cell, calibration: Calibration, recording: Recording) -> Situation:
    """Situation of the views that a calibration predicts, at its transforms, with robots assumed exact."""
    known = known_views(cell, recording, calibration)
    stride = max(-(-sum(map(len, known.problem.groups)) // MOST_VIEWS), 1)
    groups = [group.take(np.arange(0, len(group), stride)) for group in known.problem.groups]
    problem = replace(
        known.problem, groups=tuple(group.without_stops() for group in groups), stops=Stops(np.zeros((0, 6)))
    )
    state = without_errors(problem, known.state)
    problem, _ = choose_correspondence(problem, state)
    return Situation(problem, state, problem, recording.stamps)


def _robot_covariance(innovations: Innovations, calibration: Calibration) -> Array:
    """Covariance of the views from the errors of the robots' poses, (6 n, 6 n)."""
    out = np.zeros(innovations.predicted.shape)
    for robot in innovations.robots:
        known = calibration.noise.get("robots", {}).get(robot, {})
        by_flange = innovations.flange_jacobian(robot)
        poses, stand = innovations.recorded_stops(robot)
        each = innovations.root.mT @ (by_flange * _sigmas(known))
        out += np.einsum("iar,ij,jbr->iajb", each, stand[:, None] == stand[None], each).reshape(out.shape)
        for name in (name for name in RANDOM_EFFECTS if name in known):
            errors = _flange_tangents(innovations, robot, poses, RANDOM_EFFECTS[name], known[name])
            moved = innovations.whiten(by_flange @ errors)
            out += moved @ moved.T
    return out


def _flange_tangents(
    innovations: Innovations, robot: str, poses: SE3, effect: RandomEffect, sigmas: Mapping[str, Any]
) -> Array:
    """Right tangents of a robot's flange in all views for one sigma of each error that stops share, (n, 6, k).

    Without recorded joints, or the sigma of each error, errors of joints and links are modelled as smooth in the pose.
    Each sample with a stamp is treated as possibly taken in motion.
    """
    posture = innovations.posture(robot)
    by_joints = None if posture is None or effect.by_joints is None else effect.by_joints(posture)
    if effect.by_times is None:
        errors = by_joints or (effect.by_poses or smooth.errors)(poses, poses)
    else:
        stamps = innovations.situation.stamps
        errors = effect.by_times(np.array([stamps.get(number, np.nan) for number in innovations.sample.tolist()]))
    if errors is None:
        return np.zeros((len(poses), 6, 0))
    if "shift_m" in sigmas and (by_joints or effect.by_poses):
        return np.asarray(errors.by_stop * np.where(errors.is_turn, sigmas["turn_rad"], sigmas["shift_m"]))
    return np.asarray(errors.by_stop * np.array(sigmas["sigma"])[:, None])


def _sigmas(sigmas: Mapping[str, Any]) -> Array:
    """Sigmas of a future robot pose, (6,) [m, rad]; zeros if no noise is known.

    Sigmas from few samples are uncertain by factors: the rms over their posterior is used, not the likeliest value.
    """
    if not sigmas:
        return np.zeros(6)
    return float(sigmas.get("rms_factor") or 1.0) * np.array([*sigmas["sigma_t_m"], *sigmas["sigma_r_rad"]])


_SAME_CHI2 = 25.0  # five sigmas, a probability of 6e-7: a smaller excess may be due to second-order terms of noise


class ViewTangents(NamedTuple):
    """The tangent from predicted to observed `camera_from_target`, (n, 6), and its information, (n, 6, 6)."""

    tangent: Array
    information: Array


def first_order_tangents(linear: ViewInformation) -> ViewTangents:
    """Tangents to the optima of views, from their linearisation."""
    step = spectrum(linear.information, VIEW_ROUNDING).inverse @ linear.gradient[..., None]
    return ViewTangents(-step[..., 0], linear.information)


def view_tangents(measurement: PixelMeasurement, prediction: SE3, camera: Camera) -> ViewTangents:
    """Tangents from predictions to views: to first order if that is valid, else from the pose of each view alone.

    The first order of a view is not valid about a prediction with a large error. Points that are predicted outside the
    lens have no information. The pose of a view alone uses all points. The tangent from the prediction to that pose is
    linear in the shift of one frame, even for large shifts.

    Args:
        measurement: n views.
        prediction: (n,) `camera_from_target`.
        camera: The lens.
    """
    linear = measurement.linearise(prediction, camera, False)
    near = first_order_tangents(linear)
    rows = np.flatnonzero(~_is_first_order(measurement, prediction, camera, near) | ~np.isfinite(linear.cost))
    if not len(rows):
        return near
    tangent, information = near.tangent.copy(), near.information.copy()
    tangent[rows], information[rows] = _far_tangents(measurement.take(rows), prediction[rows], camera)
    return ViewTangents(tangent, information)


def _is_first_order(measurement: PixelMeasurement, prediction: SE3, camera: Camera, linear: ViewTangents) -> BoolArray:
    """Mask of the views whose first-order step reaches the optimum, (n,)."""
    reached = measurement.linearise(prediction @ SE3.exp(linear.tangent), camera, False)
    gain = -np.sum(first_order_tangents(reached).tangent * reached.gradient, axis=-1)
    return np.asarray(np.isfinite(reached.cost) & (gain < _SAME_CHI2))


def _far_tangents(measurement: PixelMeasurement, prediction: SE3, camera: Camera) -> ViewTangents:
    """Tangents from predictions to the poses of single views; from point directions to first order without a pose."""
    bearings = _bearings(measurement, camera)
    coarse = first_order_tangents(bearings.linearise(prediction, None, False))
    if len(measurement.points_in_target) < FEWEST_POINTS:
        return coarse
    own = _own_poses(measurement, bearings, prediction, camera)
    tangent = (prediction.inverse() @ own.camera_from_target).log()
    transport = right_jacobian(tangent)  # the error of the pose is in its own axes
    return ViewTangents(
        np.where(own.has_pose[:, None], tangent, coarse.tangent),
        np.where(own.has_pose[:, None, None], transport.mT @ own.information @ transport, coarse.information),
    )


class _OwnPoses(NamedTuple):
    """Pose of each view alone, (n,), its information, (n, 6, 6), and mask of the views that determine a pose, (n,)."""

    camera_from_target: SE3
    information: Array
    has_pose: BoolArray


def _own_poses(
    measurement: PixelMeasurement, bearings: BearingMeasurement, prediction: SE3, camera: Camera
) -> _OwnPoses:
    """Best-fitting pose of each view, (n,), refined from the prediction and from the closed forms."""
    closed = view_poses(measurement.points_in_target, bearings.bearings_in_camera, bearings.weight > 0, bearings)
    starts = [prediction, closed.camera_from_target[:, 0], closed.camera_from_target[:, 1]]
    ends = [refine_poses(measurement, start, camera) for start in starts]
    cost = np.stack([np.nan_to_num(end.cost, nan=np.inf, posinf=np.inf) for end in ends])
    choice = np.argmin(cost, axis=0)
    rows: IntArray = choice * len(prediction) + np.arange(len(prediction))
    poses = concatenate([end.camera_from_target for end in ends])[rows]
    information = np.concatenate([end.information for end in ends])[rows]
    return _OwnPoses(poses, information, closed.has_pose & np.isfinite(cost.min(0)))


def _bearings(measurement: PixelMeasurement, camera: Camera) -> BearingMeasurement:
    """Directions of the observed points, with weights from the sigmas of their pixels."""
    bearings, valid = camera.undistort(measurement.pixels)
    weight = np.where(measurement.seen & valid, measurement.weight, 0.0) * float(camera.focal.mean())
    return BearingMeasurement(measurement.points_in_target, np.where(valid[..., None], bearings, 0.0), weight)
