"""Copies of a problem with other robot noise, or with some of its views, and with renumbered stops."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from basecal.estimation.problem.problem import Problem, State, Stops
from basecal.estimation.problem.view_group import End
from basecal.geometry import SE3, Array, BoolArray, IntArray


def count_stops(problem: Problem, robot: str) -> int:
    """Number of a robot's stops with views."""
    stands = [end.stop_number for end in problem.robot_ends(robot)]
    return len(np.unique(np.concatenate(stands))) if stands else 0


def stop_poses(problem: Problem, robot: str) -> tuple[SE3, BoolArray]:
    """Recorded flange poses of all stops of a robot, (stops,), and a mask of the stops with views, (stops,)."""
    count = _highest_stand(problem, robot) + 1
    rotation, translation = np.tile(np.eye(3), (count, 1, 1)), np.zeros((count, 3))
    seen = np.zeros(count, dtype=bool)
    for end in problem.robot_ends(robot):
        rotation[end.stop_number], translation[end.stop_number] = (
            end.base_from_flange.rotation,
            end.base_from_flange.translation,
        )
        seen[end.stop_number] = True
    return SE3(rotation, translation), seen


def with_robot_noise(problem: Problem, sigmas: Mapping[str, Array]) -> Problem:
    """Return the problem with new noise of some robots; other robots are unchanged.

    Args:
        problem: The problem.
        sigmas: (6,) [m, rad] in flange axes, by robot.
    """
    kept = ~problem.stops.robot_mask(sigmas)
    renumbered = np.cumsum(kept) - 1  # new numbers of the stops that are kept
    sigma = [problem.stops.sigma[kept]]
    names = [name for name in problem.stops.robot if name not in sigmas]
    first: dict[str, int] = {}
    for robot in sorted(sigmas):
        count = _highest_stand(problem, robot) + 1
        first[robot] = len(names)
        names += [robot] * count
        sigma.append(np.broadcast_to(sigmas[robot], (count, 6)))
    numbered = problem.with_ends(lambda end: _renumber(end, renumbered, first))
    return replace(numbered, stops=Stops(np.concatenate(sigma), tuple(names)))


def without_errors(problem: Problem, state: State) -> State:
    """Return the state with zero errors for all stops of the problem."""
    return replace(state, stop_errors=np.zeros((len(problem.stops), 6)))


def _highest_stand(problem: Problem, robot: str) -> int:
    highest = [int(end.stop_number.max(initial=-1)) for end in problem.robot_ends(robot)]
    return max((*highest, problem.stop_counts.get(robot, 0) - 1))


def _renumber(end: End, numbers: IntArray, first: Mapping[str, int]) -> End:
    """Return an end with renumbered rows of its stops' errors."""
    if end.robot is not None and end.robot in first:
        return replace(end, stop=end.stop_number + first[end.robot])
    return replace(end, stop=np.append(numbers, -1)[end.stop])


def some_views(problem: Problem, state: State, max_count: int) -> tuple[Problem, State]:
    """Return the problem with at most `max_count` evenly spaced views of each group, and its state.

    Stops without views, and views of the static scene, are removed.
    """
    groups = [g.take(np.arange(0, len(g), -(-len(g) // max_count))) for g in problem.groups if len(g)]
    seen = np.zeros(len(problem.stops) + 1, dtype=bool)
    for group in groups:
        for end in group.ends:
            seen[end.stop] = True
    kept = np.flatnonzero(seen[:-1])  # the last is for views without a stop
    row = np.full(len(seen), -1, dtype=np.int64)
    row[kept] = np.arange(len(kept))
    stops = Stops(problem.stops.sigma[kept], tuple(problem.stops.robot[k] for k in kept))
    renumbered = (group.with_ends(lambda end: replace(end, stop=row[end.stop])) for group in groups)
    few = replace(problem.with_groups(renumbered), stops=stops, tied=None)
    return few, replace(state, stop_errors=state.stop_errors[kept])


def recorded_subset(problem: Problem, state: State, max_count: int) -> tuple[Problem, State]:
    """Return the subset of `some_views`, with the robots' stops numbered as if only these views were recorded."""
    few, state = some_views(problem, state, max_count)
    recorded = {r: np.unique(np.concatenate([end.stop_number for end in few.robot_ends(r)])) for r in few.robots}

    def renumber(end: End) -> End:
        """Renumber the stops of an end among its robot's stops in these views."""
        if end.robot is None:
            return end
        return replace(end, stop_number=np.searchsorted(recorded[end.robot], end.stop_number))

    renumbered = (group.with_ends(renumber) for group in few.groups)
    return replace(
        few.with_groups(renumbered), stop_counts={robot: len(stands) for robot, stands in recorded.items()}
    ), state
