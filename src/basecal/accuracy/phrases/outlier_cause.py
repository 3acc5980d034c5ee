"""Hypotheses under which outliers would fit: exchanged rows of a robot, or another unit."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from basecal.accuracy.phrases.sample_list import list_samples
from basecal.estimation.problem.problem import Problem, State
from basecal.estimation.problem.view_group import ViewGroup
from basecal.geometry import SE3, Array, IntArray

_SPREAD = 3.0  # of the worst view that was kept, as the fit saw no such row; held by slips 9 and 20 of `benchmarks`
_MOST_OUTLIERS = 12  # whose pairs are tried; assumed: bounds the time
# Metres in what a row may have been written in, by definition.
_UNITS = {"millimetres": 1e-3, "metres among millimetres": 1e3}


def outlier_causes(problem: Problem, state: State, numbers: Sequence[int]) -> Iterator[str]:
    """Sentences about robots' rows under which views that were left out fit about as well as the others.

    Args:
        problem: As it was recorded, outliers among it.
        state: The answer without them.
        numbers: The samples that were left out.
    """
    for group in problem.groups:
        bare, of_outliers = group.without_stops(), np.isin(group.sample, list(numbers))
        rows = np.flatnonzero(of_outliers)
        if not 0 < len(rows) <= _MOST_OUTLIERS or len(rows) == len(group):
            continue
        limit = _SPREAD**2 * float(_costs(problem, state, bare)[~of_outliers].max())
        for robot in group.robots:
            yield from _exchanged_rows(problem, state, bare, limit, robot, rows)
            pose = _recorded_poses(bare, robot)
            for unit, factor in _UNITS.items():
                scaled = _with_poses(bare, robot, SE3(pose.rotation, factor * pose.translation))
                fits = rows[_costs(problem, state, scaled)[rows] <= limit]
                if len(fits):
                    few = list_samples(group.sample[fits].tolist())
                    yield f"{few[:1].upper()}{few[1:]} of {robot} look like {unit}."


def _exchanged_rows(
    problem: Problem, state: State, group: ViewGroup, limit: float, robot: str, rows: IntArray
) -> Iterator[str]:
    pose = _recorded_poses(group, robot)
    for first, second in combinations(rows.tolist(), 2):
        order = np.arange(len(group))
        order[[first, second]] = second, first
        exchanged = _with_poses(group, robot, pose[order]).take(np.array([first, second]))
        if np.all(_costs(problem, state, exchanged) <= limit):
            both = " and ".join(map(str, sorted(group.sample[[first, second]].tolist())))
            yield f"The poses of {robot} at samples {both} are exchanged."


def _recorded_poses(group: ViewGroup, robot: str) -> SE3:
    end = group.robot_end(robot)
    assert end is not None
    return end.base_from_flange


def _with_poses(group: ViewGroup, robot: str, pose: SE3) -> ViewGroup:
    return group.with_ends(lambda end: replace(end, base_from_flange=pose, joints=None) if end.robot == robot else end)


def _costs(problem: Problem, state: State, group: ViewGroup) -> Array:
    """Squares of what each view's residuals are in sigmas, (n,); infinite if it cannot have seen so."""
    predicted = state.camera_from_target(group, problem.stops)
    cost = group.measurement.linearise(predicted, state.cameras.get(group.camera), False).cost
    return np.nan_to_num(cost, nan=np.inf)
