"""A state by the poses of all views together.

A pair that was seen twice or three times does not determine its mounts; several pairs that share them do. Loops of
poses are brought together downhill of random rotations: of twenty rings of three arms one in five ends at the optimum.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from basecal.cell import Cell
from basecal.estimation.least_squares.bundle_adjustment import bundle_adjust_batch
from basecal.estimation.problem.problem import Problem, State, Stops, sequential_columns
from basecal.estimation.start.first_state import known_transforms, lenses
from basecal.estimation.start.pair_views import PairViews, pair_views
from basecal.estimation.view.poses import PoseMeasurement
from basecal.geometry import SE3
from basecal.numerics.batch import take

_VIEWS, _POINTS = 100, 40  # of a pair at most; assumed: bounds the time
_STARTS = 100  # of which all miss the optimum in 0.2 % of the worst of twenty rings, where one in sixteen hits it
_SEED = 1  # any other would do


def joint_state(problem: Problem, cell: Cell) -> State | None:
    """The state at which the poses of all views agree best; None if some view has no pose, or there is one pair.

    Args:
        problem: The problem.
        cell: Where the lenses and what is known of them stand.
    """
    cameras = lenses(problem, cell)
    shown = [group for group in problem.groups if group.measurement.equations().any()]
    sights = [pair_views(group, cameras.get(group.camera), _VIEWS, _POINTS) for group in shown]
    if len(sights) < 2 or any(sight.candidates is None for sight in sights):
        return None
    by_poses = _pose_problem(problem, sights)
    known, count = known_transforms(problem), _STARTS
    turns = np.random.default_rng(_SEED).normal(size=(len(problem.unknowns), count, 4))
    turns /= np.linalg.norm(turns, axis=-1, keepdims=True)
    begun = {
        name: known[name].repeat(count) if name in known else SE3.from_quaternion(turn, np.zeros((count, 3)))
        for name, turn in zip(problem.unknowns, turns, strict=True)
    }
    ends = bundle_adjust_batch(by_poses, State(begun, {}, np.zeros((count, 0, 6))), dof=1)
    best = take(ends.state, int(np.nanargmin(ends.cost)))
    return State(dict(best.transforms), cameras, np.zeros((len(problem.stops), 6)))


def _pose_problem(problem: Problem, sights: list[PairViews]) -> Problem:
    """The problem of the likeliest poses of views, of robots without errors."""
    groups = []
    for sight in sights:
        assert sight.candidates is not None
        weight = np.repeat(sight.weight[:, None], 6, axis=1)
        measurement = PoseMeasurement(sight.candidates[:, 0], weight, weight)
        groups.append(replace(sight.group.without_stops(), measurement=measurement, readings=()))
    columns = sequential_columns({n: problem.column_width(n) for n in problem.columns if n in problem.unknowns})
    return Problem(
        problem.reference, tuple(groups), problem.unknowns, problem.point_mounts, {}, Stops(np.zeros((0, 6))), columns
    )
