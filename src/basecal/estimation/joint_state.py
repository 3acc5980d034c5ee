"""Initial state from the target poses of all views together.

Two or three views of one camera and target do not determine their mounts; several pairs that share mounts do. The pose
loops are closed by descents from random rotations. For twenty rings of three arms, one descent in five ends at the
optimum.
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

_VIEWS, _POINTS = 100, 40  # most views and points per pair; assumed: bounds the time
# For the worst of twenty rings, one start in sixteen finds the optimum: all starts miss it in 0.2 % of cases.
_STARTS = 100
_SEED = 1  # any seed works
_CONVERGED_SIGMAS = 0.1  # distance to the optimum, which is sought again from the best of the ends


def joint_state(problem: Problem, cell: Cell) -> State | None:
    """State that fits the target poses of all views best; None if some pair has no poses, or there is one pair only.

    Args:
        problem: The problem.
        cell: The cell, with the stated lenses.
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
    ends = bundle_adjust_batch(by_poses, State(begun, {}, np.zeros((count, 0, 6))), dof=1, tolerance=_CONVERGED_SIGMAS)
    best = take(ends.state, int(np.nanargmin(ends.cost)))
    return State(dict(best.transforms), cameras, np.zeros((len(problem.stops), 6)))


def _pose_problem(problem: Problem, sights: list[PairViews]) -> Problem:
    """Make the problem whose measurements are the most likely poses of the views, with exact robots."""
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
