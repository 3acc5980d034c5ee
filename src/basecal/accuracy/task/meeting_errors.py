"""How far flanges that were sent to one point are from where they should be to one another, by all that is unknown.

Arms given by joints have errors of joints and links if nothing is stated of these. Models of such errors explain the
views, and give the errors of both flanges elsewhere. The errors of arms given by poses are smooth in the pose: a base
absorbs most of them, and counts with them. Source: docs/mathematics.md (14.3), (14.6).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from basecal.accuracy.systematic_errors.expected_sizes import size_posterior
from basecal.accuracy.systematic_errors.pose_fields import LongAxes, PoseField, pose_field, stated_fields, variances
from basecal.accuracy.systematic_errors.situation import Situation
from basecal.accuracy.task.arm_errors import ArmErrors
from basecal.accuracy.task.kinematic_errors import moved_by_errors, nearest_poses, to_base_axes
from basecal.accuracy.task.meeting import Meeting, add_own
from basecal.effects.faces.shared_errors import SharedErrors
from basecal.effects.registry import RANDOM_EFFECTS
from basecal.estimation.noise.joint_estimate import (
    companion_name,
    model_priors,
    open_robots,
)
from basecal.estimation.noise.laplace import SigmaPosterior, moments
from basecal.estimation.noise.robot_noise import stands
from basecal.estimation.problem.problem import Problem
from basecal.estimation.solve import Solution
from basecal.geometry import SE3, Array
from basecal.numerics.mixtures import Gaussian, mixture, probabilities

_LEAST_SHARE = 1e-3  # of a model by its probability: a less likely one changes no digit that is shown


def meeting_errors(
    meeting: Meeting, arms: ArmErrors, noise: Mapping[str, Any], widening: Array | None = None
) -> tuple[Array, Array]:
    """Mean, (n, 6), and covariance, (n, 6, 6), of the error of place and rotation where robots meet [m, rad].

    In the axes of the base. The mean is what a model of the arms' errors finds that the answer leaves in them.

    Args:
        meeting: Who meets, and where.
        arms: Errors of arms about what it was made of.
        noise: Of a calibration.
        widening: (p, p) what of the solution's covariance is beside the noise of the problem; nothing where None.
    """
    own = {robot: _own_variance(meeting, arms.solution, noise, robot) for robot in meeting.places_m}
    by_joints = _models_by_joints(meeting, arms)
    models = by_joints or _models_by_poses(meeting, arms)
    fields = 0.0 if by_joints else field_covariance(meeting, arms)
    if models:
        shares, likely = zip(*_likely_models(models), strict=True)
        mean, covariance = _mixture(shares, [_model_error(meeting, own, model, widening) for model in likely])
    else:
        mean = np.zeros(meeting.moves.moved.shape[:2])
        covariance = meeting.total_error(arms.solution.covariance, own.values())
    return mean, covariance + fields


@dataclass(frozen=True, eq=False)
class _Model:
    """A model of the arms' errors.

    Attributes:
        sigmas: What is known of its sigmas.
        moved: By robot that has such errors, their first column, and how what meets moves with them, (n, 6, k).
        unknown: Places of sigmas, and the share of their variance that no recorded pose has, (n,).
        prior: Its probability before the data, in proportion to those of the others.
    """

    sigmas: SigmaPosterior
    moved: Sequence[tuple[int, Array]]
    unknown: Sequence[tuple[slice, Array]]
    prior: float = 1.0


def _models_by_joints(meeting: Meeting, arms: ArmErrors) -> list[_Model]:
    """Models of errors of joints and links of arms that meet."""
    problem, state = meeting.problem, meeting.state
    models = []
    for kinds, sigmas in arms.joint_models:
        (columns,) = sigmas.model.layout.shared
        moved = [
            (columns[robot][0], meeting.propagate(robot, moved_by_errors(problem, state, robot, where_m, kinds)))
            for robot, where_m in meeting.places_m.items()
            if robot in columns
        ]
        if moved:
            models.append(_Model(sigmas, moved, []))
    return models


def _models_by_poses(meeting: Meeting, arms: ArmErrors) -> list[_Model]:
    """No errors but those of single stops, and errors smooth in pose or time, of arms that meet and record poses alone.

    Of errors in time nothing is known where arms meet.
    """
    if not set(open_robots(meeting.problem)) & meeting.places_m.keys():
        return []
    found, models = arms.fitted.noise.models, {}
    for name, sigmas in found.items():
        if name in ("", *POSE_EFFECTS):
            models[name] = _model_by_poses(meeting, sigmas, name, 0)
        elif RANDOM_EFFECTS[name].by_times is not None:
            of = _model_by_poses(meeting, sigmas, companion_name(name, found), 1)
            columns, places = sigmas.model.layout.shared[0], sigmas.model.sigmas.shared[0]
            alone = [(places[r], np.ones(len(at))) for r, at in meeting.places_m.items() if r in columns]
            models[name] = replace(of, unknown=[*of.unknown, *alone])
    return [
        replace(models[name], prior=float(prior)) for name, prior in zip(models, model_priors([*models]), strict=True)
    ]


def _model_by_poses(meeting: Meeting, sigmas: SigmaPosterior, name: str, number: int) -> _Model:
    """A model with errors smooth in the pose, which are the kind of that number among its shared ones, or none."""
    if name not in POSE_EFFECTS:
        return _Model(sigmas, [], [])
    columns, places = sigmas.model.layout.shared[number], sigmas.model.sigmas.shared[number]
    arms = {r: at for r, at in meeting.places_m.items() if r in columns}
    moves = {r: moved_by_pose_errors(meeting.problem, r, at, name) for r, at in arms.items()}
    moved = [(columns[r][0], meeting.propagate(r, of)) for r, of in moves.items()]
    return _Model(sigmas, moved, [(places[r], unseen_share(meeting.problem, r, at, name)) for r, at in arms.items()])


def _model_error(
    meeting: Meeting, own: Mapping[str, Array], model: _Model, widening: Array | None
) -> tuple[Array, Array]:
    """Mean, (n, 6), and covariance, (n, 6, 6), of the error under a model, its sigmas integrated."""
    known, places = meeting.moves, model.sigmas.model.sigmas
    columns = [known.columns, *(first + np.arange(of.shape[-1]) for first, of in model.moved)]
    mean, products, squares = moments(model.sigmas, np.concatenate(columns))
    if widening is not None:
        products[: len(known.columns), : len(known.columns)] += widening[np.ix_(known.columns, known.columns)]
    moved = np.concatenate([known.moved, *(of for _, of in model.moved)], axis=-1)
    estimated = {robot: squares[places.stops[robot]] for robot in meeting.places_m if robot in places.stops}
    covariance = add_own(moved @ products @ np.swapaxes(moved, 1, 2), {**own, **estimated}.values())
    for at, share in model.unknown:
        covariance = covariance + share[:, None, None] * np.diag(np.repeat(squares[at], 3))
    return moved @ mean, covariance


def _likely_models(models: Sequence[_Model]) -> list[tuple[float, _Model]]:
    """The models that are likely by their priors and their evidence, with their probabilities."""
    prior = np.array([model.prior for model in models])
    shares = probabilities(prior, -np.array([model.sigmas.minus_2_log_evidence for model in models]))
    return [(share, model) for share, model in zip(shares.tolist(), models, strict=True) if share > _LEAST_SHARE]


def _mixture(shares: Sequence[float], errors: Sequence[tuple[Array, Array]]) -> tuple[Array, Array]:
    """Mean, (n, 6), and covariance, (n, 6, 6), of errors whose models have these probabilities."""
    means, covariances = zip(*errors, strict=True)
    known = Gaussian(np.zeros(len(shares)), np.stack(means, -2), np.stack(covariances, -3))
    found = mixture(np.array(shares), known)
    return found.mean, found.covariance


def _own_variance(meeting: Meeting, solution: Solution, noise: Mapping[str, Any], robot: str) -> Array:
    """Mean variance of a robot's own error along an axis, of its flange's place and turn, (2,) [m^2, rad^2]."""
    of_stop = solution.noise.robot_variances.get(robot)
    own = meeting.stop_variance(robot) if of_stop is None else of_stop.reshape(2, 3).mean(1)
    told = noise.get("robots", {}).get(robot, {})
    return np.asarray(own + sum(np.square(told[n]["sigma"]).reshape(2, 3).mean(1) for n in RANDOM_EFFECTS if n in told))


POSE_EFFECTS = tuple(name for name, effect in RANDOM_EFFECTS.items() if effect.by_poses is not None)
"""Effects that arms without joints may have, and are models of one error at most."""


def moved_by_pose_errors(problem: Problem, robot: str, points_in_base_m: Array, name: str) -> Array:
    """How the flange of a robot moves with the errors of an effect, (n, 6, k) in the axes of its base [m, rad].

    At a recorded place, base and error together are known far better than either alone. Beyond recorded poses an arm
    has errors of its own, of the same variance. Source: docs/mathematics.md (14.3).

    Args:
        problem: What was recorded.
        robot: A robot that has some.
        points_in_base_m: (n, 3) where its flange is, in its base [m].
        name: One of `POSE_EFFECTS`.
    """
    poses = nearest_poses(problem, robot, points_in_base_m)
    return to_base_axes(_errors_by_modes(problem, robot, poses, name).by_stop, poses.rotation)


def unseen_share(problem: Problem, robot: str, points_in_base_m: Array, name: str) -> Array:
    """Share of the variance of such errors at points that no recorded pose has, (n,)."""
    errors = _errors_by_modes(problem, robot, nearest_poses(problem, robot, points_in_base_m), name)
    known = np.sum(errors.by_stop[:, :3, ~errors.is_turn] ** 2, axis=(1, 2)) / 3
    return np.asarray(np.maximum(1 - known, 0.0))


def _errors_by_modes(problem: Problem, robot: str, poses: SE3, name: str) -> SharedErrors:
    by_poses = RANDOM_EFFECTS[name].by_poses
    assert by_poses is not None
    recorded, seen = stands(problem, robot)
    errors = by_poses(recorded[np.flatnonzero(seen)], poses)
    assert errors is not None
    return errors


def field_covariance(meeting: Meeting, arms: ArmErrors) -> Array:
    """Covariance of place and rotation where flanges meet, by fields of arms that record poses alone, (n, 6, 6).

    Within the recorded poses the errors are known as far as the data show, with the part that the answer absorbs.
    Beyond them, an arm has the errors of an uncalibrated arm. Source: docs/mathematics.md (14.3).

    Args:
        meeting: Who meets, and where.
        arms: Errors of arms about what came out.
    """
    situation = arms.situation
    (moved, columns), points_m = meeting.moves, meeting.places_m
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
    """Errors of robots with estimated noise beyond their recorded poses: within these the noise contains them."""
    total: Array | float = 0.0
    for robot, points in points_m.items():
        field = pose_field(situation, robot)
        if field is not None and robot in situation.problem.unstated:
            poses = nearest_poses(situation.problem, robot, points)
            total = total + _unknown_covariance(field, poses, size_posterior(situation, [field]).field_m2)
    return total


def _unknown_covariance(error: PoseField | LongAxes, poses: SE3, field_m2: float) -> Array:
    """Covariance of a flange beyond recorded poses, (n, 6, 6)."""
    return error.unknown_share(poses)[:, None, None] * np.diag(np.repeat(variances(field_m2), 3))
