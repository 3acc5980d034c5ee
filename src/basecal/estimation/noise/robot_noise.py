"""A problem with other sigmas of its robots' recorded poses."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from basecal.estimation.problem.problem import Problem, State, Stops
from basecal.estimation.problem.view_group import End
from basecal.geometry import SE3, Array, BoolArray, IntArray


def count_stops(problem: Problem, robot: str) -> int:
    """How many stops a robot made, of those that a view was taken at."""
    stands = [end.stand for end in problem.robot_ends(robot)]
    return len(np.unique(np.concatenate(stands))) if stands else 0


def stands(problem: Problem, robot: str) -> tuple[SE3, BoolArray]:
    """Recorded poses of a robot's flange at each of its stops, by number, and at which something was seen, (stops,)."""
    count = _highest_stand(problem, robot) + 1
    rotation, translation = np.tile(np.eye(3), (count, 1, 1)), np.zeros((count, 3))
    seen = np.zeros(count, dtype=bool)
    for end in problem.robot_ends(robot):
        rotation[end.stand], translation[end.stand] = end.base_from_flange.rotation, end.base_from_flange.translation
        seen[end.stand] = True
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
    numbered = problem.with_ends(lambda end: _renumber(end, renumbered, first))
    return replace(numbered, stops=Stops(np.concatenate(sigma), tuple(names)))


def without_errors(problem: Problem, state: State) -> State:
    """The state with every stop's error zero, as many as the problem has."""
    return replace(state, stop_errors=np.zeros((len(problem.stops), 6)))


def _highest_stand(problem: Problem, robot: str) -> int:
    highest = [int(end.stand.max(initial=-1)) for end in problem.robot_ends(robot)]
    return max((*highest, problem.stands.get(robot, 0) - 1))


def _renumber(end: End, rows: IntArray, first: Mapping[str, int]) -> End:
    """An end with other rows of its stops' errors."""
    if end.robot is not None and end.robot in first:
        return replace(end, stop=end.stand + first[end.robot])
    return replace(end, stop=np.append(rows, -1)[end.stop])
