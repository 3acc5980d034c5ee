"""How far flanges that were sent to one point are from where they should be to one another, by all that is unknown.

Arms given by joints, of whose joints and links nothing is stated, have errors of these: models of them explain the
views, and say what both flanges are off by elsewhere. Of others what their stops have in common counts in full.
Source: docs/mathematics.md (14.3), (14.6).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from basecal.accuracy.task.arms_at_points import moved_by_kinematics
from basecal.accuracy.task.kinematic_errors import EXPECTED_PRIOR, MODELS, kinematic_errors, moved_by_errors
from basecal.accuracy.task.task import Task
from basecal.cell import Calibration, Cell
from basecal.effects.faces.shared_errors import SharedErrors
from basecal.effects.registry import RANDOM_EFFECTS
from basecal.estimation.noise.joint_estimate import open_robots, sigmas_with
from basecal.estimation.noise.laplace import moments
from basecal.estimation.solve import Solution
from basecal.geometry import Array, IntArray
from basecal.geometry.rotation import cross_matrix


def meeting_errors(
    cell: Cell, calibration: Calibration, solution: Solution, task: Task, points_m: Array, widening: Array | None = None
) -> tuple[Array, Array]:
    """What place and turn are off by where robots meet: its mean, (n, 6), and covariance, (n, 6, 6) [m, rad].

    In the axes of the base. The mean is what a model of the arms' errors finds that the answer leaves in them.

    Args:
        cell: What was calibrated.
        calibration: What came out, with the noise of its robots.
        solution: What it was made of.
        task: The points, and which transform brings them from one robot to another.
        points_m: (n, 3) the same points in the reference's base [m].
        widening: (p, p) what of the solution's covariance is beside the noise of the problem; nothing where None.
    """
    others = [r for r in cell.robots if r != cell.reference and cell.base_name(r) == task.transform]
    meeting = {cell.reference: points_m} | dict.fromkeys(others, task.points_m)
    at = _Meeting(solution, task, cell.reference, meeting)
    known = at.column_jacobian()
    own = {robot: _own_variance(calibration, solution, robot) for robot in meeting}
    models = _models_of_arms(solution, meeting)
    if not models:
        products = solution.covariance[np.ix_(known.columns, known.columns)]
        return np.zeros(known.moved.shape[:2]), _total_error(known.moved, products, own.values())
    return _mixture([_model_error(at, known, own, model, widening) for model in models])


class _Known(NamedTuple):
    """Columns of the problem, (c,), and how what meets moves with them, (n, 6, c)."""

    moved: Array
    columns: IntArray


@dataclass(frozen=True, eq=False)
class _Meeting:
    """Robots that a transform brings together, one of them the reference, and where, in the base of each.

    Attributes:
        solution: What the errors are those of.
        task: The points in the other robot's base, and the transform.
        reference: The robot in whose base all is placed.
        points_m: (n, 3) of each robot [m].
    """

    solution: Solution
    task: Task
    reference: str
    points_m: Mapping[str, Array]

    def column_jacobian(self) -> _Known:
        """All that was estimated."""
        problem, state = self.solution.problem, self.solution.state
        own = problem.columns[self.task.transform]
        by_base = np.broadcast_to(np.eye(6), (len(self.task.points_m), 6, 6)).copy()
        by_base[:, :3, 3:] = -cross_matrix(self.task.points_m)
        moved, columns = [by_base[:, :, : own.stop - own.start]], [np.arange(own.start, own.stop)]
        for robot, where_m in self.points_m.items():
            found = moved_by_kinematics(problem, state, robot, where_m)
            if found is not None:
                moved.append(self.propagate(robot, found[0]))
                columns.append(found[1])
        return _Known(np.concatenate(moved, axis=-1), np.concatenate(columns))

    def propagate(self, robot: str, flange_jacobian: Array) -> Array:
        """How what meets moves, in the axes of the task's base, with what moves a flange, in those of its own."""
        if robot != self.reference:
            return flange_jacobian
        turned = self.solution.state.transforms[self.task.transform].rotation.T
        return np.asarray(-np.kron(np.eye(2), turned) @ flange_jacobian)


class _ArmErrors(NamedTuple):
    """Kinds of errors that arms may have, and what the stops of each robot have in common by them."""

    kinds: tuple[str, ...]
    of: Mapping[str, SharedErrors]


class _Expected(NamedTuple):
    """By one model: minus twice the log of its evidence, mean, (n, 6), and covariance, (n, 6, 6)."""

    surprise: float
    mean: Array
    covariance: Array


def _model_error(
    meeting: _Meeting, knowns: _Known, own: Mapping[str, Array], model: _ArmErrors, widening: Array | None
) -> _Expected:
    """What is off by a model of the arms' errors, its sigmas integrated."""
    problem, state = meeting.solution.problem, meeting.solution.state
    sigmas = sigmas_with(problem, state, meeting.solution.noise, model.of, EXPECTED_PRIOR)
    every_move, every_column = [knowns.moved], [knowns.columns]
    for robot in (name for name in meeting.points_m if name in model.of):
        by_errors = moved_by_errors(problem, state, robot, meeting.points_m[robot], model.kinds)
        first = sigmas.model.layout.common[robot][0]
        every_move.append(meeting.propagate(robot, by_errors))
        every_column.append(np.arange(first, first + by_errors.shape[-1]))
    mean, products, squares = moments(sigmas, np.concatenate(every_column))
    if widening is not None:
        products[: len(knowns.columns), : len(knowns.columns)] += widening[np.ix_(knowns.columns, knowns.columns)]
    estimated = {robot: squares[sigmas.model.sigmas.stops[robot]] for robot in model.of}
    moved, variances = np.concatenate(every_move, axis=-1), {**own, **estimated}
    return _Expected(
        sigmas.surprise, moved @ mean, _total_error(moved, products, (variances[robot] for robot in meeting.points_m))
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


def _total_error(moved: Array, products: Array, own: Iterable[Array]) -> Array:
    """Of columns by how what meets moves with them, (n, 6, c), and of robots' own errors along an axis, (2,) each."""
    return np.asarray(moved @ products @ np.swapaxes(moved, 1, 2) + np.diag(np.repeat(sum(own, np.zeros(2)), 3)))


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


def _own_variance(calibration: Calibration, solution: Solution, robot: str) -> Array:
    """Mean variance of a robot's own error along an axis, of its flange's place and turn, (2,) [m^2, rad^2]."""
    noise = calibration.noise.get("robots", {}).get(robot)
    if noise is None:
        return np.zeros(2)
    of_stop = solution.noise.robot_variances.get(robot, np.square([*noise["sigma_t_m"], *noise["sigma_r_rad"]]))
    common = [np.square(noise[name]["sigma"]) for name in RANDOM_EFFECTS if name in noise]
    own: Array = np.array([of_stop, *common]).reshape(-1, 2, 3).mean(-1).sum(0)
    return own
