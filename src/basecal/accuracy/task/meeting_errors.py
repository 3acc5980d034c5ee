"""How far flanges that were sent to one point are from where they should be to one another, by all that is unknown.

Arms given by joints, of whose joints and links nothing is stated, have errors of these: a model of them explains the
views, and says what both flanges are off by elsewhere. Of others what their stops have in common counts in full.
Source: docs/mathematics.md (14.3), (14.6).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from basecal.accuracy.task.arms_at_points import moved_by_kinematics
from basecal.accuracy.task.kinematic_errors import EXPECTED, kinematic_errors, moved_by_errors
from basecal.accuracy.task.task import Task
from basecal.cell import Calibration, Cell
from basecal.estimation.noise.joint_estimate import open_robots, sigmas_with
from basecal.estimation.noise.laplace import moments
from basecal.estimation.noise.reml import sigmas_of
from basecal.estimation.noise.terms.common_errors import CommonErrors
from basecal.estimation.solve import Solution
from basecal.geometry import Array, IntArray
from basecal.geometry.rotation import hat
from basecal.registry import NOISE_TERMS


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
    # The robots that the transform brings together, and where they meet in the base of each, (n, 3) [m].
    others = [r for r in cell.robots if r != cell.reference and cell.base_name(r) == task.transform]
    meeting = {cell.reference: points_m} | dict.fromkeys(others, task.points_m)
    arms = _arms_with_errors(solution)
    moved, columns = _by_columns(cell, solution, task, meeting)
    if not arms.keys() & meeting.keys():
        products = solution.covariance[np.ix_(columns, columns)]
        own = [_own_variance(calibration, solution, robot) for robot in meeting]
        return np.zeros(moved.shape[:2]), _in_all(moved, products, own)
    sigmas = sigmas_with(solution.problem, solution.state, solution.noise, arms, EXPECTED)
    every_move, every_column = [moved], [columns]
    for robot in (name for name in meeting if name in arms):
        by_errors = moved_by_errors(solution.problem, solution.state, robot, meeting[robot])
        first = sigmas.model.layout.common[robot][0]
        every_move.append(_of_meeting(cell, solution, task, robot, by_errors))
        every_column.append(np.arange(first, first + by_errors.shape[-1]))
    mean, products, squares = moments(sigmas, np.concatenate(every_column))
    if widening is not None:
        products[: len(columns), : len(columns)] += widening[np.ix_(columns, columns)]
    own = [
        squares[sigmas_of(sigmas.model, robot)] if robot in arms else _own_variance(calibration, solution, robot)
        for robot in meeting
    ]
    moved = np.concatenate(every_move, axis=-1)
    return moved @ mean, _in_all(moved, products, own)


def _in_all(moved: Array, products: Array, own: Iterable[Array]) -> Array:
    """Of columns by how what meets moves with them, (n, 6, c), and of robots' own errors along an axis, (2,) each."""
    return np.asarray(moved @ products @ np.swapaxes(moved, 1, 2) + np.diag(np.repeat(sum(own, np.zeros(2)), 3)))


def _by_columns(cell: Cell, solution: Solution, task: Task, meeting: Mapping[str, Array]) -> tuple[Array, IntArray]:
    """How what meets moves with all that was estimated, (n, 6, c), and the columns of the problem, (c,)."""
    own = solution.problem.columns[task.transform]
    by_base = np.broadcast_to(np.eye(6), (len(task.points_m), 6, 6)).copy()
    by_base[:, :3, 3:] = -hat(task.points_m)
    moved, columns = [by_base[:, :, : own.stop - own.start]], [np.arange(own.start, own.stop)]
    for robot, where_m in meeting.items():
        found = moved_by_kinematics(solution.problem, solution.state, robot, where_m)
        if found is not None:
            moved.append(_of_meeting(cell, solution, task, robot, found[0]))
            columns.append(found[1])
    return np.concatenate(moved, axis=-1), np.concatenate(columns)


def _of_meeting(cell: Cell, solution: Solution, task: Task, robot: str, of_flange: Array) -> Array:
    """How what meets moves, in the axes of the task's base, with what moves a robot's flange, in those of its own."""
    if robot != cell.reference:
        return of_flange
    turned = solution.state.transforms[task.transform].rotation.T
    return np.asarray(-np.kron(np.eye(2), turned) @ of_flange)


def _arms_with_errors(solution: Solution) -> dict[str, CommonErrors]:
    """Errors of joints and links, by robot; none where noise was not estimated, of all views at once."""
    if solution.noise.logs is None:
        return {}
    problem, state = solution.problem, solution.state
    found = {robot: kinematic_errors(problem, state, robot) for robot in open_robots(problem)}
    return {robot: errors for robot, errors in found.items() if errors is not None}


def _own_variance(calibration: Calibration, solution: Solution, robot: str) -> Array:
    """Mean variance of a robot's own error along an axis, of its flange's place and turn, (2,) [m^2, rad^2]."""
    noise = calibration.noise.get("robots", {}).get(robot)
    if noise is None:
        return np.zeros(2)
    of_stop = solution.noise.robot_variances.get(robot, np.square([*noise["sigma_t_m"], *noise["sigma_r_rad"]]))
    common = [np.square(noise[term]["sigma"]) for term in NOISE_TERMS if term in noise]
    own: Array = np.array([of_stop, *common]).reshape(-1, 2, 3).mean(-1).sum(0)
    return own
