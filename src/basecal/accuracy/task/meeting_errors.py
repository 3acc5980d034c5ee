"""Relative error of two flanges that are sent to one point, from all uncertain quantities.

Arms recorded by joints have errors of joints and links unless their sizes are stated. Models of such errors explain the
views, and predict the errors of both flanges elsewhere. The errors of arms recorded by poses are smooth in the pose.
The base estimate absorbs most of them, so their correlation is included. Source: docs/mathematics.md (14.3), (14.6).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from basecal.accuracy.systematic_errors.expected_sizes import size_posterior
from basecal.accuracy.systematic_errors.pose_fields import AxisLengths, PoseField, pose_field, stated_fields, variances
from basecal.accuracy.systematic_errors.situation import Situation
from basecal.accuracy.task.arm_errors import ArmErrors
from basecal.accuracy.task.kinematic_errors import error_jacobian, nearest_poses, to_base_axes
from basecal.accuracy.task.meeting import Meeting, add_own_variances
from basecal.effects.faces.shared_errors import SharedErrors
from basecal.effects.registry import RANDOM_EFFECTS
from basecal.estimation.noise.joint_estimate import (
    companion_name,
    model_priors,
    open_robots,
)
from basecal.estimation.noise.laplace import SigmaPosterior, moments
from basecal.estimation.noise.robot_noise import stop_poses
from basecal.estimation.problem.problem import Problem
from basecal.estimation.solve import Solution
from basecal.geometry import SE3, Array
from basecal.numerics.mixtures import Gaussian, mixture, probabilities

_LEAST_SHARE = 1e-3  # smallest probability of a model in use: a less likely model changes no reported digit


def meeting_errors(
    meeting: Meeting, arms: ArmErrors, noise: Mapping[str, Any], widening: Array | None = None
) -> tuple[Array, Array]:
    """Mean, (n, 6), and covariance, (n, 6, 6), of the pose error between flanges at meeting points [m, rad].

    The axes are those of the base. The mean is the arm error that a model estimates and the solution does not contain.

    Args:
        meeting: Robots that meet, and the points.
        arms: Errors of arms about the solution.
        noise: Noise of the calibration.
        widening: (p, p) part of the solution's covariance that is not due to the problem's noise; zero if None.
    """
    own = {robot: _own_variance(meeting, arms.solution, noise, robot) for robot in meeting.places_m}
    by_joints = _models_by_joints(meeting, arms)
    models = by_joints or _models_by_poses(meeting, arms)
    fields = 0.0 if by_joints else field_covariance(meeting, arms)
    if models:
        shares, likely = zip(*_likely_models(models), strict=True)
        mean, covariance = _mixture(shares, [_model_error(meeting, own, model, widening) for model in likely])
    else:
        mean = np.zeros(meeting.jacobian.values.shape[:2])
        covariance = meeting.total_covariance(arms.solution.covariance, own.values())
    return mean, covariance + fields


@dataclass(frozen=True, eq=False)
class _Model:
    """A model of the arms' errors.

    Attributes:
        sigmas: Posterior of the model's sigmas.
        jacobians: For each robot with such errors, their first column, and the derivative of the meeting error with
            respect to them, (n, 6, k).
        unknown: Indices of sigmas, and the share of their variance that no recorded pose shows, (n,).
        prior: Prior probability of the model, up to a common factor.
    """

    sigmas: SigmaPosterior
    jacobians: Sequence[tuple[int, Array]]
    unknown: Sequence[tuple[slice, Array]]
    prior: float = 1.0


def _models_by_joints(meeting: Meeting, arms: ArmErrors) -> list[_Model]:
    """Models of joint and link errors of arms that meet."""
    problem, state = meeting.problem, meeting.state
    models = []
    for kinds, sigmas in arms.joint_models:
        (columns,) = sigmas.model.layout.shared
        moved = [
            (columns[robot][0], meeting.propagate(robot, error_jacobian(problem, state, robot, where_m, kinds)))
            for robot, where_m in meeting.places_m.items()
            if robot in columns
        ]
        if moved:
            models.append(_Model(sigmas, moved, []))
    return models


def _models_by_poses(meeting: Meeting, arms: ArmErrors) -> list[_Model]:
    """Models of arms recorded by poses: single-stop errors only, and errors that are smooth in pose or time.

    Errors in time at the recorded samples have no information about errors at the meeting points.
    """
    if not set(open_robots(meeting.problem)) & meeting.places_m.keys():
        return []
    found, models = arms.fitted.noise.models, {}
    for name, sigmas in found.items():
        if name in ("", *POSE_EFFECTS):
            models[name] = _model_by_poses(meeting, sigmas, name, 0)
        elif RANDOM_EFFECTS[name].by_times is not None:
            base_model = _model_by_poses(meeting, sigmas, companion_name(name, found), 1)
            columns, sigma_indices = sigmas.model.layout.shared[0], sigmas.model.sigmas.shared[0]
            alone = [(sigma_indices[r], np.ones(len(at))) for r, at in meeting.places_m.items() if r in columns]
            models[name] = replace(base_model, unknown=[*base_model.unknown, *alone])
    return [
        replace(models[name], prior=float(prior)) for name, prior in zip(models, model_priors([*models]), strict=True)
    ]


def _model_by_poses(meeting: Meeting, sigmas: SigmaPosterior, name: str, index: int) -> _Model:
    """Return a model with errors that are smooth in the pose; `index` is their index among the shared errors.

    The model has no shared errors if `name` is no effect of `POSE_EFFECTS`.
    """
    if name not in POSE_EFFECTS:
        return _Model(sigmas, [], [])
    columns, sigma_indices = sigmas.model.layout.shared[index], sigmas.model.sigmas.shared[index]
    arms = {r: at for r, at in meeting.places_m.items() if r in columns}
    moves = {r: pose_error_jacobian(meeting.problem, r, at, name) for r, at in arms.items()}
    moved = [(columns[r][0], meeting.propagate(r, jacobian)) for r, jacobian in moves.items()]
    return _Model(
        sigmas, moved, [(sigma_indices[r], unseen_share(meeting.problem, r, at, name)) for r, at in arms.items()]
    )


def _model_error(
    meeting: Meeting, own: Mapping[str, Array], model: _Model, widening: Array | None
) -> tuple[Array, Array]:
    """Mean, (n, 6), and covariance, (n, 6, 6), of the error under a model, its sigmas integrated out."""
    known, stops = meeting.jacobian, model.sigmas.model.sigmas.stops
    columns = [known.columns, *(first + np.arange(jacobian.shape[-1]) for first, jacobian in model.jacobians)]
    mean, products, squares = moments(model.sigmas, np.concatenate(columns))
    if widening is not None:
        products[: len(known.columns), : len(known.columns)] += widening[np.ix_(known.columns, known.columns)]
    moved = np.concatenate([known.values, *(jacobian for _, jacobian in model.jacobians)], axis=-1)
    estimated = {robot: squares[stops[robot]] for robot in meeting.places_m if robot in stops}
    covariance = add_own_variances(moved @ products @ np.swapaxes(moved, 1, 2), {**own, **estimated}.values())
    for at, share in model.unknown:
        covariance = covariance + share[:, None, None] * np.diag(np.repeat(squares[at], 3))
    return moved @ mean, covariance


def _likely_models(models: Sequence[_Model]) -> list[tuple[float, _Model]]:
    """Return the likely models with their posterior probabilities, from priors and evidence."""
    prior = np.array([model.prior for model in models])
    shares = probabilities(prior, -np.array([model.sigmas.minus_2_log_evidence for model in models]))
    return [(share, model) for share, model in zip(shares.tolist(), models, strict=True) if share > _LEAST_SHARE]


def _mixture(shares: Sequence[float], errors: Sequence[tuple[Array, Array]]) -> tuple[Array, Array]:
    """Mean, (n, 6), and covariance, (n, 6, 6), of a mixture of errors with the probabilities `shares`."""
    means, covariances = zip(*errors, strict=True)
    known = Gaussian(np.zeros(len(shares)), np.stack(means, -2), np.stack(covariances, -3))
    found = mixture(np.array(shares), known)
    return found.mean, found.covariance


def _own_variance(meeting: Meeting, solution: Solution, noise: Mapping[str, Any], robot: str) -> Array:
    """Mean variance per axis of a robot's own flange error, translation and rotation, (2,) [m^2, rad^2]."""
    of_stop = solution.noise.robot_variances.get(robot)
    own = meeting.stop_variance(robot) if of_stop is None else of_stop.reshape(2, 3).mean(1)
    stated = noise.get("robots", {}).get(robot, {})
    return np.asarray(
        own + sum(np.square(stated[n]["sigma"]).reshape(2, 3).mean(1) for n in RANDOM_EFFECTS if n in stated)
    )


POSE_EFFECTS = tuple(name for name, effect in RANDOM_EFFECTS.items() if effect.by_poses is not None)
"""Effects that are possible for arms without recorded joints; a model includes at most one of them."""


def pose_error_jacobian(problem: Problem, robot: str, points_in_base_m: Array, name: str) -> Array:
    """Derivative of a robot's flange with respect to an effect's errors, (n, 6, k) [m, rad], in its base's axes.

    At a recorded place, the sum of base and arm error is known far better than either alone. Beyond recorded poses, an
    arm has independent errors of the same variance. Source: docs/mathematics.md (14.3).

    Args:
        problem: The recorded problem.
        robot: Name of a robot with such errors.
        points_in_base_m: (n, 3) flange positions in the robot's base [m].
        name: Name of an effect of `POSE_EFFECTS`.
    """
    poses = nearest_poses(problem, robot, points_in_base_m)
    return to_base_axes(_errors_by_modes(problem, robot, poses, name).by_stop, poses.rotation)


def unseen_share(problem: Problem, robot: str, points_in_base_m: Array, name: str) -> Array:
    """Share of the variance of an effect's errors at points that no recorded pose shows, (n,)."""
    errors = _errors_by_modes(problem, robot, nearest_poses(problem, robot, points_in_base_m), name)
    known = np.sum(errors.by_stop[:, :3, ~errors.is_turn] ** 2, axis=(1, 2)) / 3
    return np.asarray(np.maximum(1 - known, 0.0))


def _errors_by_modes(problem: Problem, robot: str, poses: SE3, name: str) -> SharedErrors:
    by_poses = RANDOM_EFFECTS[name].by_poses
    assert by_poses is not None
    recorded, seen = stop_poses(problem, robot)
    errors = by_poses(recorded[np.flatnonzero(seen)], poses)
    assert errors is not None
    return errors


def field_covariance(meeting: Meeting, arms: ArmErrors) -> Array:
    """Covariance of the pose error where flanges meet, from fields of arms recorded by poses, (n, 6, 6) [m, rad].

    Within the recorded poses, the errors have their posterior, with their correlation with the solution. Beyond them,
    an arm has the errors of an uncalibrated arm. Source: docs/mathematics.md (14.3).

    Args:
        meeting: Robots that meet, and the points.
        arms: Errors of arms about the solution.
    """
    situation = arms.situation
    (moved, columns), points_m = meeting.jacobian, meeting.places_m
    total = np.zeros((len(moved), 6, 6))
    for sizes in arms.sizes:
        by_sizes = np.zeros((len(moved), 6, len(sizes.mean)))
        for error, own in sizes.of_arms:
            if error.robot in points_m:
                poses = nearest_poses(situation.problem, error.robot, points_m[error.robot])
                tangents = to_base_axes(error.flange_tangents(poses), poses.rotation)
                by_sizes[..., own] = meeting.propagate(error.robot, tangents)
                total += _unknown_covariance(error, poses, sizes.field_m2)
        mixed = moved @ (sizes.by_sizes @ sizes.covariance)[columns] @ by_sizes.mT
        total += mixed + mixed.mT + by_sizes @ sizes.covariance @ by_sizes.mT
    stated = {field.robot for field in stated_fields(meeting.cell, situation)}
    return total + _open_fields(situation, {r: at for r, at in points_m.items() if r not in stated})


def _open_fields(situation: Situation, points_m: Mapping[str, Array]) -> Array | float:
    """Covariance of errors beyond recorded poses for robots with estimated noise, (n, 6, 6); 0 if there are none.

    Within the recorded poses, the estimated noise contains these errors.
    """
    total: Array | float = 0.0
    for robot, points in points_m.items():
        field = pose_field(situation, robot)
        if field is not None and robot in situation.problem.unstated:
            poses = nearest_poses(situation.problem, robot, points)
            total = total + _unknown_covariance(field, poses, size_posterior(situation, [field]).field_m2)
    return total


def _unknown_covariance(error: PoseField | AxisLengths, poses: SE3, field_m2: float) -> Array:
    """Covariance of a flange from errors that no recorded pose shows, (n, 6, 6) [m, rad]."""
    return error.unknown_share(poses)[:, None, None] * np.diag(np.repeat(variances(field_m2), 3))
