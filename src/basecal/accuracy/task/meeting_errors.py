"""How far flanges that were sent to one point are from where they should be to one another, by all that is unknown.

Arms given by joints have errors of joints and links if nothing is stated of these. Models of such errors explain the
views, and give the errors of both flanges elsewhere. The errors of arms given by poses are smooth in the pose: a base
absorbs most of them, and counts with them. Source: docs/mathematics.md (14.3), (14.6).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from basecal.accuracy.systematic_errors.situation import OpenOffsets
from basecal.accuracy.task.field_errors import field_covariance
from basecal.accuracy.task.kinematic_errors import EXPECTED_PRIOR, MODELS, kinematic_errors, moved_by_errors
from basecal.accuracy.task.meeting import Meeting, add_own
from basecal.accuracy.task.pose_errors import POSE_EFFECTS, moved_by_pose_errors, unseen_share
from basecal.effects.faces.shared_errors import SharedErrors, SharedTerm
from basecal.effects.registry import RANDOM_EFFECTS
from basecal.estimation.noise.joint_estimate import companion_name, model_sigmas, open_robots, sigma_models
from basecal.estimation.noise.laplace import SigmaPosterior, moments
from basecal.estimation.solve import Solution
from basecal.geometry import Array

_LEAST_SHARE = 1e-3  # of a model by its evidence: a less likely one changes no digit that is shown


def meeting_errors(
    meeting: Meeting,
    solution: Solution,
    noise: Mapping[str, Any],
    widening: Array | None = None,
    offsets: OpenOffsets | None = None,
) -> tuple[Array, Array]:
    """Mean, (n, 6), and covariance, (n, 6, 6), of the error of place and rotation where robots meet [m, rad].

    In the axes of the base. The mean is what a model of the arms' errors finds that the answer leaves in them.

    Args:
        meeting: Who meets, and where.
        solution: What it was made of.
        noise: Of a calibration.
        widening: (p, p) what of the solution's covariance is beside the noise of the problem; nothing where None.
        offsets: Of clocks that were estimated beside the solution; None without any.
    """
    own = {robot: _own_variance(meeting, solution, noise, robot) for robot in meeting.places_m}
    by_joints = _models_by_joints(meeting, solution)
    models = by_joints or _models_by_poses(meeting, solution)
    fields = 0.0 if by_joints else field_covariance(meeting, solution, offsets)
    if models:
        mean, covariance = _mixture([_model_error(meeting, own, model, widening) for model in _likely_models(models)])
    else:
        mean = np.zeros(meeting.moves.moved.shape[:2])
        covariance = meeting.total_error(solution.covariance, own.values())
    return mean, covariance + fields


@dataclass(frozen=True, eq=False)
class _Model:
    """A model of the arms' errors.

    Attributes:
        sigmas: What is known of its sigmas.
        moved: By robot that has such errors, their first column, and how what meets moves with them, (n, 6, k).
        unknown: Places of sigmas, and the share of their variance that no recorded pose has, (n,).
    """

    sigmas: SigmaPosterior
    moved: Sequence[tuple[int, Array]]
    unknown: Sequence[tuple[slice, Array]]


def _models_by_joints(meeting: Meeting, solution: Solution) -> list[_Model]:
    """Models of errors of joints and links of arms that meet; none if no such arm's noise is estimated.

    Where one kind has a prior, two of `MODELS` are the same errors, and count once.
    """
    problem, state = meeting.problem, meeting.state
    if solution.noise.logs is None:
        return []
    models: dict[tuple[int, ...], _Model] = {}
    for kinds in MODELS:
        found = {robot: kinematic_errors(problem, state, robot, kinds) for robot in open_robots(problem)}
        arms = {robot: errors for robot, errors in found.items() if errors is not None}
        key = tuple(len(errors.is_turn) for errors in arms.values())
        if arms.keys() & meeting.places_m.keys() and key not in models:
            sigmas = model_sigmas(problem, state, solution.noise, SharedTerm(arms, EXPECTED_PRIOR))
            columns = sigmas.model.layout.common
            moved = [
                (columns[robot][0], meeting.propagate(robot, moved_by_errors(problem, state, robot, where_m, kinds)))
                for robot, where_m in meeting.places_m.items()
                if robot in arms
            ]
            models[key] = _Model(sigmas, moved, [])
    return list(models.values())


def _models_by_poses(meeting: Meeting, solution: Solution) -> list[_Model]:
    """No errors but those of single stops, and errors smooth in pose or time, of arms that meet and record poses alone.

    Of errors in time nothing is known where arms meet.
    """
    problem = meeting.problem
    if solution.noise.logs is None or not set(open_robots(problem)) & meeting.places_m.keys():
        return []
    found = sigma_models(problem, meeting.state, solution.noise, solution.noise.logs_by_model)
    models = []
    for name, sigmas in found.items():
        layout, places = sigmas.model.layout, sigmas.model.sigmas
        if name in ("", *POSE_EFFECTS):
            models.append(_model_by_poses(meeting, sigmas, name, layout.common, places.shared))
        elif RANDOM_EFFECTS[name].by_times is not None:
            of = _model_by_poses(meeting, sigmas, companion_name(name, found), layout.beside, places.beside)
            alone = [(places.shared[r], np.ones(len(at))) for r, at in meeting.places_m.items() if r in layout.common]
            models.append(replace(of, unknown=[*of.unknown, *alone]))
    return models


def _model_by_poses(
    meeting: Meeting,
    sigmas: SigmaPosterior,
    name: str,
    columns: Mapping[str, tuple[int, SharedErrors]],
    places: Mapping[str, slice],
) -> _Model:
    """A model with errors smooth in the pose, or none, by the columns of these and the places of their sigmas."""
    arms = {r: at for r, at in meeting.places_m.items() if r in columns and name in POSE_EFFECTS}
    moves = {r: moved_by_pose_errors(meeting.problem, r, at, name) for r, at in arms.items()}
    moved = [(columns[r][0], meeting.propagate(r, of)) for r, of in moves.items()]
    return _Model(sigmas, moved, [(places[r], unseen_share(meeting.problem, r, at, name)) for r, at in arms.items()])


class _Expected(NamedTuple):
    """Twice the negative log evidence of one model, its mean, (n, 6), and covariance, (n, 6, 6)."""

    minus_2_log_evidence: float
    mean: Array
    covariance: Array


def _model_error(meeting: Meeting, own: Mapping[str, Array], model: _Model, widening: Array | None) -> _Expected:
    """The error under a model of the arms' errors, its sigmas integrated."""
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
    return _Expected(model.sigmas.minus_2_log_evidence, moved @ mean, covariance)


def _likely_models(models: Sequence[_Model]) -> list[_Model]:
    """The likely models: the others have hardly any evidence beside the likeliest."""
    least = min(model.sigmas.minus_2_log_evidence for model in models)
    return [model for model in models if model.sigmas.minus_2_log_evidence - least < -2 * np.log(_LEAST_SHARE)]


def _mixture(errors: Sequence[_Expected]) -> tuple[Array, Array]:
    """Mean and covariance over models, which count by their evidence."""
    least = min(each.minus_2_log_evidence for each in errors)
    shares = np.exp([-0.5 * (each.minus_2_log_evidence - least) for each in errors])
    shares /= shares.sum()
    mean = np.einsum("m,mni->ni", shares, [each.mean for each in errors])
    off = np.array([each.mean for each in errors]) - mean
    spread = np.array([each.covariance for each in errors]) + off[..., None] * off[..., None, :]
    return mean, np.einsum("m,mnij->nij", shares, spread)


def _own_variance(meeting: Meeting, solution: Solution, noise: Mapping[str, Any], robot: str) -> Array:
    """Mean variance of a robot's own error along an axis, of its flange's place and turn, (2,) [m^2, rad^2]."""
    of_stop = solution.noise.robot_variances.get(robot)
    own = meeting.stop_variance(robot) if of_stop is None else of_stop.reshape(2, 3).mean(1)
    told = noise.get("robots", {}).get(robot, {})
    return np.asarray(own + sum(np.square(told[n]["sigma"]).reshape(2, 3).mean(1) for n in RANDOM_EFFECTS if n in told))
