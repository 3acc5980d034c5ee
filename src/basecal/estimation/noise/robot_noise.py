"""A problem with other sigmas of its robots' recorded poses."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from basecal.estimation.problem.problem import Problem, State, Stops, ViewGroup
from basecal.geometry import SE3, Array, BoolArray, IntArray


def stops_made(problem: Problem, robot: str) -> int:
    """How many stops a robot made, of those that a view was taken at."""
    stands = [g.eye_stand for g in problem.groups if g.eye == robot]
    stands += [g.hand_stand for g in problem.groups if g.hand == robot]
    return len(np.unique(np.concatenate(stands))) if stands else 0


def stands(problem: Problem, robot: str) -> tuple[SE3, BoolArray]:
    """Recorded poses of a robot's flange at each of its stops, by number, and at which something was seen, (stops,)."""
    count = _highest_stand(problem, robot) + 1
    rotation, translation = np.tile(np.eye(3), (count, 1, 1)), np.zeros((count, 3))
    seen = np.zeros(count, dtype=bool)
    for group in problem.groups:
        for name, stand, poses in (
            (group.eye, group.eye_stand, group.eye_base_from_eye_flange),
            (group.hand, group.hand_stand, group.hand_base_from_hand_flange),
        ):
            if name == robot:
                rotation[stand], translation[stand] = poses.rotation, poses.translation
                seen[stand] = True
    return SE3(rotation, translation), seen


def with_robot_noise(problem: Problem, sigmas: Mapping[str, Array]) -> Problem:
    """The problem with these robots' noise in place of what they had; the other robots keep theirs.

    Args:
        problem: The problem.
        sigmas: By robot, (6,) [m, rad] in flange axes.
    """
    kept = np.array([name not in sigmas for name in problem.stops.robot], dtype=bool)
    renumbered = np.cumsum(kept) - 1  # of stops that are kept
    sigma, names = [problem.stops.sigma[kept]], [n for n, k in zip(problem.stops.robot, kept, strict=True) if k]
    first: dict[str, int] = {}
    for robot in sorted(sigmas):
        count = _highest_stand(problem, robot) + 1
        first[robot] = len(names)
        names += [robot] * count
        sigma.append(np.broadcast_to(sigmas[robot], (count, 6)))
    groups = tuple(_renumbered(group, renumbered, first) for group in problem.groups)
    return replace(problem, groups=groups, stops=Stops(np.concatenate(sigma), tuple(names)))


def without_errors(problem: Problem, state: State) -> State:
    """The state with every stop's error zero, as many as the problem has."""
    return replace(state, stop_errors=np.zeros((len(problem.stops), 6)))


def _highest_stand(problem: Problem, robot: str) -> int:
    of_eyes = [int(g.eye_stand.max(initial=-1)) for g in problem.groups if g.eye == robot]
    of_hands = [int(g.hand_stand.max(initial=-1)) for g in problem.groups if g.hand == robot]
    return max((*of_eyes, *of_hands, problem.stands.get(robot, 0) - 1))


def _renumbered(group: ViewGroup, renumbered: IntArray, first: Mapping[str, int]) -> ViewGroup:
    def rows(robot: str | None, stop: IntArray, stand: IntArray) -> IntArray:
        """Rows of the stops' errors of a robot's views."""
        if robot is not None and robot in first:
            return stand + first[robot]
        return np.append(renumbered, -1)[stop]

    return replace(
        group,
        eye_stop=rows(group.eye, group.eye_stop, group.eye_stand),
        hand_stop=rows(group.hand, group.hand_stop, group.hand_stand),
    )
