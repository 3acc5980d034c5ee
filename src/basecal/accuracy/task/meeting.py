"""Where two flanges meet, and how far apart they are by all that is estimated of the base between them and of the arms.

Base, joints and links move what meets together: a joint offset that turned the base does not count twice. A gauge that
both share, such as that of a first joint and the base, does not count. Source: docs/mathematics.md (14.3).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from basecal.accuracy.task.kinematic_errors import moved_by_kinematics
from basecal.accuracy.task.task import placed_transforms
from basecal.cell import Calibration, Cell
from basecal.estimation.problem.problem import Problem, State
from basecal.estimation.problem.view_group import ViewGroup
from basecal.estimation.solve import Solution
from basecal.geometry import Array, IntArray
from basecal.geometry.rotation import cross_matrix

_MOST_PLACES = 60  # of those recorded: more of them say the same of a smooth function of the place


class Moves(NamedTuple):
    """Columns of the problem, (c,), and how what meets moves with them, (n, 6, c)."""

    moved: Array
    columns: IntArray


@dataclass(frozen=True, eq=False)
class Meeting:
    """Robots that a transform brings together, one of them the reference, and where.

    Attributes:
        problem: What was recorded, with the noise in use.
        state: What was found.
        transform: `reference_base_from_b`.
        reference: The robot in whose base all is placed.
        points_m: (n, 3) in b [m].
        places_m: (n, 3) of each robot that meets, in its base [m].
        cell: What was calibrated.
    """

    problem: Problem
    state: State
    transform: str
    reference: str
    points_m: Array
    places_m: Mapping[str, Array]
    cell: Cell

    @cached_property
    def moves(self) -> Moves:
        """Moves by all that was estimated, in the axes of b."""
        own = self.problem.column_indices([self.transform])
        by_base = np.broadcast_to(np.eye(6), (len(self.points_m), 6, 6)).copy()
        by_base[:, :3, 3:] = -cross_matrix(self.points_m)
        moved, columns = [by_base[:, :, : len(own)]], [own]
        for robot, where_m in self.places_m.items():
            found = moved_by_kinematics(self.problem, self.state, robot, where_m)
            if found is not None:
                moved.append(self.propagate(robot, found[0]))
                columns.append(found[1])
        return Moves(np.concatenate(moved, axis=-1), np.concatenate(columns))

    def propagate(self, robot: str, flange_jacobian: Array) -> Array:
        """How what meets moves, in the axes of b, with what moves a flange, in those of its own base."""
        if robot != self.reference:
            return flange_jacobian
        turned = self.state.transforms[self.transform].rotation.T
        return -np.kron(np.eye(2), turned) @ flange_jacobian

    @cached_property
    def weight(self) -> Array:
        """(p, p) W: the trace of W C is the mean square of the distance [m^2], C the covariance of all columns."""
        moved, columns = self.moves
        weight = np.zeros((self.problem.width, self.problem.width))
        weight[np.ix_(columns, columns)] = (np.swapaxes(moved[:, :3], 1, 2) @ moved[:, :3]).mean(0)
        return weight

    def stop_variance(self, robot: str) -> Array:
        """Mean variance of a robot's stops along an axis, of place and turn, (2,) [m^2, rad^2]; 0 of an exact one."""
        mine = np.array([name == robot for name in self.problem.stops.robot], dtype=bool)
        squares = self.problem.stops.sigma[mine] ** 2
        return squares.reshape(-1, 2, 3).mean((0, 2)) if mine.any() else np.zeros(2)

    def mean_square_m2(self, covariance: Array) -> float:
        """Mean square of the distance [m^2], with this covariance of all columns, (p, p), and the robots' stops."""
        stops = sum(float(of_stop[0]) for of_stop in self.stop_variances().values())
        return float(np.trace(self.weight @ covariance)) + 3 * stops

    def stop_variances(self) -> dict[str, Array]:
        """Variance of the stops of each robot that meets, as `stop_variance`."""
        return {robot: self.stop_variance(robot) for robot in self.places_m}

    def total_error(self, covariance: Array, own: Iterable[Array]) -> Array:
        """(n, 6, 6) of what is off [m, rad] with this covariance of all columns, (p, p), and robots' own, (2,) each."""
        moved, columns = self.moves
        return add_own(moved @ covariance[np.ix_(columns, columns)] @ np.swapaxes(moved, 1, 2), own)


def add_own(covariances: Array, own: Iterable[Array]) -> Array:
    """Covariances of what is off, (n, 6, 6), with robots' own variances along an axis, (2,) each, on top."""
    return covariances + np.diag(np.repeat(sum(own, np.zeros(2)), 3))


def make_meeting(cell: Cell, problem: Problem, state: State, transform: str, points_m: Array) -> Meeting:
    """The meeting at points in the reference's base, (n, 3) [m], of what a transform places there."""
    others = [name for name in cell.robots if name != cell.reference and cell.base_name(name) == transform]
    in_other = state.transforms[transform].inverse() @ points_m
    places = {cell.reference: points_m} | dict.fromkeys(others, in_other)
    return Meeting(problem, state, transform, cell.reference, in_other, places, cell)


def worst_meeting(meetings: Iterable[Meeting], covariance: Array) -> Meeting:
    """The meeting of several with the largest error, by the covariance of all columns, (p, p)."""
    return max(meetings, key=lambda meeting: meeting.mean_square_m2(covariance))


def find_worst_meeting(cell: Cell, calibration: Calibration, solution: Solution, task_m: Array) -> Meeting | None:
    """The meeting with the largest error of what a calibration places, at `meeting_places`; None if that is nothing."""
    problem, state = solution.problem, solution.state
    known = [name for name in placed_transforms(cell) if name in calibration.transforms]
    places = {name: meeting_places(problem, state, name, task_m) for name in known}
    meetings = [make_meeting(cell, problem, state, name, at) for name, at in places.items()]
    return worst_meeting(meetings, solution.covariance) if meetings else None


def meeting_places(problem: Problem, state: State, transform: str, task_m: Array) -> Array:
    """The task's places in the reference's base, (n, 3) [m]; without a task, (0, 3), the recorded ones."""
    return task_m if len(task_m) else recorded_places(problem, state, transform)


def recorded_places(problem: Problem, state: State, transform: str) -> Array:
    """Where what a transform places was seen, in the reference's base, (n, 3) [m]; at most so many, evenly chosen."""
    groups = [group for group in problem.groups if transform in group.frames] or problem.groups
    return choose_places(np.concatenate([target_places(group, state) for group in groups]))


def choose_places(places: Array) -> Array:
    """At most so many of places, (n, 3) [m], evenly chosen."""
    chosen = np.unique(np.linspace(0, len(places) - 1, min(len(places), _MOST_PLACES)).astype(int))
    return np.asarray(places[chosen])


def target_places(group: ViewGroup, state: State) -> Array:
    """Where targets were in the reference's base, (n, 3); the camera instead of one that stays where it is."""
    end = group.eye if group.hand.robot is None else group.hand
    world_from_flange = end.world_from_base(state.transforms) @ end.base_from_flange
    return (world_from_flange @ state.transforms[end.mount]).translation
