"""Two flanges at a common point, and their distance error from the estimates of the base and of both arms.

Base, joints and links are treated jointly. The effect of a joint offset that rotated the base therefore counts once. A
gauge of base and joints, such as that of a first joint and the base, has no effect. Source: docs/mathematics.md (14.3).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from basecal.accuracy.task.kinematic_errors import kinematics_jacobian
from basecal.accuracy.task.task import placed_transforms
from basecal.cell import Calibration, Cell
from basecal.estimation.problem.problem import Problem, State
from basecal.estimation.problem.view_group import ViewGroup
from basecal.estimation.solve import Solution
from basecal.geometry import Array, IntArray
from basecal.geometry.rotation import cross_matrix
from basecal.numerics.batch import space_evenly

_MOST_PLACES = 60  # of the recorded places: the error is a smooth function of the place, so more add nothing


class MeetingJacobian(NamedTuple):
    """Derivative of the meeting error with respect to estimated columns, (n, 6, c), and these columns, (c,)."""

    values: Array
    columns: IntArray


@dataclass(frozen=True, eq=False)
class Meeting:
    """Points at which robots meet, one of them the reference, and the transform between their bases.

    The meeting error is the error of one flange relative to the other at such a point, (6,) [m, rad].

    Attributes:
        problem: The recorded problem, with the noise in use.
        state: The estimated state.
        transform: Name of the transform, `reference_base_from_b`.
        reference: Name of the reference robot, in whose base the points are placed.
        points_m: (n, 3) points in b [m].
        places_m: (n, 3) points in the base of each robot that meets [m].
        cell: The calibrated cell.
    """

    problem: Problem
    state: State
    transform: str
    reference: str
    points_m: Array
    places_m: Mapping[str, Array]
    cell: Cell

    @cached_property
    def jacobian(self) -> MeetingJacobian:
        """Derivative of the meeting error with respect to all estimated columns that affect it, in the axes of b."""
        own = self.problem.column_indices([self.transform])
        by_base = np.broadcast_to(np.eye(6), (len(self.points_m), 6, 6)).copy()
        by_base[:, :3, 3:] = -cross_matrix(self.points_m)
        moved, columns = [by_base[:, :, : len(own)]], [own]
        for robot, where_m in self.places_m.items():
            found = kinematics_jacobian(self.problem, self.state, robot, where_m)
            if found is not None:
                moved.append(self.propagate(robot, found[0]))
                columns.append(found[1])
        return MeetingJacobian(np.concatenate(moved, axis=-1), np.concatenate(columns))

    def propagate(self, robot: str, flange_jacobian: Array) -> Array:
        """Convert a derivative of a robot's flange, in the axes of its base, to one of the meeting error, in b."""
        if robot != self.reference:
            return flange_jacobian
        rotation = self.state.transforms[self.transform].rotation.T
        return -np.kron(np.eye(2), rotation) @ flange_jacobian

    @property
    def weight(self) -> Array:
        """(p, p) matrix W: trace(W C) is the mean squared distance [m^2] for a covariance C of all columns."""
        columns = self.jacobian.columns
        weight = np.zeros((self.problem.width, self.problem.width))
        weight[np.ix_(columns, columns)] = self._own_weight
        return weight

    @property
    def _own_weight(self) -> Array:
        """(c, c) matrix as `weight`, of the columns of `jacobian`: few of those of a hundred robots."""
        moved = self.jacobian.values[:, :3]
        return np.asarray((moved.mT @ moved).mean(0))

    def stop_variance(self, robot: str) -> Array:
        """Mean variance per axis of a robot's stop errors, translation and rotation, (2,) [m^2, rad^2]; 0 if exact."""
        squares = self.problem.stops.sigma[self.problem.stops.robot_mask([robot])] ** 2
        return squares.reshape(-1, 2, 3).mean((0, 2)) if len(squares) else np.zeros(2)

    def mean_square_m2(self, covariance: Array) -> float:
        """Mean squared distance [m^2] from a covariance of all columns, (p, p), and the stop errors of the robots."""
        stops = sum(float(of_stop[0]) for of_stop in self.stop_variances().values())
        columns = self.jacobian.columns
        return float(np.sum(self._own_weight * covariance[np.ix_(columns, columns)])) + 3 * stops

    def stop_variances(self) -> dict[str, Array]:
        """Variance of the stops of each robot that meets, as in `stop_variance`."""
        return {robot: self.stop_variance(robot) for robot in self.places_m}

    def total_covariance(self, covariance: Array, own: Iterable[Array]) -> Array:
        """Covariance of the meeting error, (n, 6, 6) [m, rad].

        Args:
            covariance: (p, p) covariance of all columns.
            own: (2,) variance per axis of each robot's own error [m^2, rad^2].
        """
        jacobian, columns = self.jacobian
        return add_own_variances(jacobian @ covariance[np.ix_(columns, columns)] @ np.swapaxes(jacobian, 1, 2), own)


def add_own_variances(covariances: Array, own: Iterable[Array]) -> Array:
    """Add the variances per axis of robots' own errors, (2,) each, to covariances, (n, 6, 6)."""
    return covariances + np.diag(np.repeat(sum(own, np.zeros(2)), 3))


def make_meeting(cell: Cell, problem: Problem, state: State, transform: str, points_m: Array) -> Meeting:
    """Return the meeting at points in the reference's base, (n, 3) [m], for a transform into this base."""
    others = [name for name in cell.robots if name != cell.reference and cell.base_name(name) == transform]
    in_other = state.transforms[transform].inverse() @ points_m
    places = {cell.reference: points_m} | dict.fromkeys(others, in_other)
    return Meeting(problem, state, transform, cell.reference, in_other, places, cell)


def worst_meeting(meetings: Iterable[Meeting], covariance: Array) -> Meeting:
    """Return the meeting with the largest error, given the covariance of all columns, (p, p)."""
    return max(meetings, key=lambda meeting: meeting.mean_square_m2(covariance))


def find_worst_meeting(cell: Cell, calibration: Calibration, solution: Solution, task_m: Array) -> Meeting | None:
    """Return the meeting with the largest error among the calibrated transforms into the reference's base.

    The points are those of `meeting_places`. None if there is no such transform.
    """
    problem, state = solution.problem, solution.state
    known = [name for name in placed_transforms(cell) if name in calibration.transforms]
    places = {name: meeting_places(problem, state, name, task_m) for name in known}
    meetings = [make_meeting(cell, problem, state, name, at) for name, at in places.items()]
    return worst_meeting(meetings, solution.covariance) if meetings else None


def meeting_places(problem: Problem, state: State, transform: str, task_m: Array) -> Array:
    """Points of the task in the reference's base, (n, 3) [m]; the recorded places if `task_m` is empty, (0, 3)."""
    return task_m if len(task_m) else recorded_places(problem, state, transform)


def recorded_places(problem: Problem, state: State, transform: str) -> Array:
    """Recorded target places of the views that depend on a transform, in the reference's base, (n, 3) [m].

    At most `_MOST_PLACES` are returned, evenly chosen.
    """
    groups = [group for group in problem.groups if transform in group.frames] or problem.groups
    return choose_places(np.concatenate([target_places(group, state) for group in groups]))


def choose_places(places: Array) -> Array:
    """Choose at most `_MOST_PLACES` of places, (n, 3) [m], evenly."""
    return np.asarray(places[space_evenly(len(places), _MOST_PLACES)])


def target_places(group: ViewGroup, state: State) -> Array:
    """Positions of a group's target in the reference's base, (n, 3) [m]; of its camera if the target is fixed."""
    end = group.eye if group.hand.robot is None else group.hand
    world_from_flange = end.world_from_base(state.transforms) @ end.base_from_flange
    return (world_from_flange @ state.transforms[end.mount]).translation
