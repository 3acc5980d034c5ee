"""How far flanges that were sent to one point are from where they should be to one another, by all that is unknown.

Arms given by joints, of whose joints and links nothing is stated, have errors of these: models of them explain the
views, and say what both flanges are off by elsewhere. Of others what their stops share counts in full.
Source: docs/mathematics.md (14.3), (14.6).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from basecal.accuracy.task.field_errors import field_covariance
from basecal.accuracy.task.kinematic_errors import EXPECTED_PRIOR, MODELS, kinematic_errors, moved_by_errors
from basecal.accuracy.task.meeting import Meeting, add_own
from basecal.effects.faces.shared_errors import SharedErrors
from basecal.effects.registry import RANDOM_EFFECTS
from basecal.estimation.noise.joint_estimate import model_sigmas, open_robots
from basecal.estimation.noise.laplace import moments
from basecal.estimation.solve import Solution
from basecal.geometry import Array


def meeting_errors(
    meeting: Meeting, solution: Solution, noise: Mapping[str, Any], widening: Array | None = None
) -> tuple[Array, Array]:
    """What place and turn are off by where robots meet: its mean, (n, 6), and covariance, (n, 6, 6) [m, rad].

    In the axes of the base. The mean is what a model of the arms' errors finds that the answer leaves in them.

    Args:
        meeting: Who meets, and where.
        solution: What it was made of.
        noise: Of a calibration.
        widening: (p, p) what of the solution's covariance is beside the noise of the problem; nothing where None.
    """
    own = {robot: _own_variance(meeting, solution, noise, robot) for robot in meeting.places_m}
    models = _models_of_arms(solution, meeting.places_m)
    if not models:
        mean = np.zeros(meeting.moves.moved.shape[:2])
        return mean, meeting.total_error(solution.covariance, own.values()) + field_covariance(meeting, solution)
    return _mixture([_model_error(meeting, solution, own, model, widening) for model in models])


class _ArmErrors(NamedTuple):
    """Kinds of errors that arms may have, and what the stops of each robot share by them."""

    kinds: tuple[str, ...]
    of: Mapping[str, SharedErrors]


class _Expected(NamedTuple):
    """By one model: minus twice the log of its evidence, mean, (n, 6), and covariance, (n, 6, 6)."""

    surprise: float
    mean: Array
    covariance: Array


def _model_error(
    meeting: Meeting, solution: Solution, own: Mapping[str, Array], model: _ArmErrors, widening: Array | None
) -> _Expected:
    """What is off by a model of the arms' errors, its sigmas integrated."""
    problem, state, known = meeting.problem, meeting.state, meeting.moves
    sigmas = model_sigmas(problem, state, solution.noise, model.of, EXPECTED_PRIOR)
    every_move, every_column = [known.moved], [known.columns]
    for robot in (name for name in meeting.places_m if name in model.of):
        by_errors = moved_by_errors(problem, state, robot, meeting.places_m[robot], model.kinds)
        first = sigmas.model.layout.common[robot][0]
        every_move.append(meeting.propagate(robot, by_errors))
        every_column.append(np.arange(first, first + by_errors.shape[-1]))
    mean, products, squares = moments(sigmas, np.concatenate(every_column))
    if widening is not None:
        products[: len(known.columns), : len(known.columns)] += widening[np.ix_(known.columns, known.columns)]
    estimated = {robot: squares[sigmas.model.sigmas.stops[robot]] for robot in model.of}
    moved, variances = np.concatenate(every_move, axis=-1), {**own, **estimated}
    by_columns = moved @ products @ np.swapaxes(moved, 1, 2)
    return _Expected(
        sigmas.surprise, moved @ mean, add_own(by_columns, (variances[robot] for robot in meeting.places_m))
    )


def _mixture(errors: Sequence[_Expected]) -> tuple[Array, Array]:
    """Mean and covariance over models, which count by their evidence."""
    least = min(each.surprise for each in errors)
    shares = np.exp([-0.5 * (each.surprise - least) for each in errors])
    shares /= shares.sum()
    mean = np.einsum("m,mni->ni", shares, [each.mean for each in errors])
    off = np.array([each.mean for each in errors]) - mean
    spread = np.array([each.covariance for each in errors]) + off[..., None] * off[..., None, :]
    return mean, np.einsum("m,mnij->nij", shares, spread)


def _models_of_arms(solution: Solution, meeting: Mapping[str, Array]) -> list[_ArmErrors]:
    """What may be wrong with the arms that meet; nothing where noise was not estimated, of all views at once.

    Where one kind has a prior, two of `MODELS` are the same errors, and count once.
    """
    if solution.noise.logs is None:
        return []
    problem, state = solution.problem, solution.state
    models: dict[tuple[int, ...], _ArmErrors] = {}
    for kinds in MODELS:
        found = {robot: kinematic_errors(problem, state, robot, kinds) for robot in open_robots(problem)}
        arms = {robot: errors for robot, errors in found.items() if errors is not None}
        if arms.keys() & meeting.keys():
            models.setdefault(tuple(len(errors.is_turn) for errors in arms.values()), _ArmErrors(kinds, arms))
    return list(models.values())


def _own_variance(meeting: Meeting, solution: Solution, noise: Mapping[str, Any], robot: str) -> Array:
    """Mean variance of a robot's own error along an axis, of its flange's place and turn, (2,) [m^2, rad^2]."""
    of_stop = solution.noise.robot_variances.get(robot)
    own = meeting.stop_variance(robot) if of_stop is None else of_stop.reshape(2, 3).mean(1)
    told = noise.get("robots", {}).get(robot, {})
    return np.asarray(own + sum(np.square(told[n]["sigma"]).reshape(2, 3).mean(1) for n in RANDOM_EFFECTS if n in told))
