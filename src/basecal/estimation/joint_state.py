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

_MOST_VIEWS, _MOST_POINTS = 100, 40  # most views and points per pair; assumed: bounds the time
# For the worst of twenty rings, one start in sixteen finds the optimum: all starts miss it in 0.2 % of cases.
_START_COUNT = 100
# Numbers in the Hessians of all starts, 40 MB: rings of twelve arms have all starts, rings of a hundred have one.
_MOST_HESSIAN_NUMBERS = 5_000_000
_SEED = 1  # any seed works
_CONVERGED_SIGMAS = 0.1  # convergence tolerance: a further descent starts from the best end


def joint_state(problem: Problem, cell: Cell) -> State | None:
    """State that fits the target poses of all views best; None if some pair has no poses, or there is one pair only.

    Args:
        problem: The problem.
        cell: The cell, with the stated lenses.
    """
    cameras = lenses(problem, cell)
    groups = [group for group in problem.groups if group.measurement.equations().any()]
    pairs = [pair_views(group, cameras.get(group.camera), _MOST_VIEWS, _MOST_POINTS) for group in groups]
    if len(pairs) < 2 or any(pair.candidates is None for pair in pairs):
        return None
    pose_problem = _pose_problem(problem, pairs)
    width = sum(column.stop - column.start for column in pose_problem.columns.values())
    known, count = known_transforms(problem), max(1, min(_START_COUNT, _MOST_HESSIAN_NUMBERS // max(1, width**2)))
    quaternions = np.random.default_rng(_SEED).normal(size=(len(problem.unknowns), count, 4))
    quaternions /= np.linalg.norm(quaternions, axis=-1, keepdims=True)
    starts = {
        name: known[name].repeat(count) if name in known else SE3.from_quaternion(quaternion, np.zeros((count, 3)))
        for name, quaternion in zip(problem.unknowns, quaternions, strict=True)
    }
    best = bundle_adjust_batch(
        pose_problem, State(starts, {}, np.zeros((count, 0, 6))), dof=1, tolerance=_CONVERGED_SIGMAS
    ).best_state
    return State(dict(best.transforms), cameras, np.zeros((len(problem.stops), 6)))


def _pose_problem(problem: Problem, pairs: list[PairViews]) -> Problem:
    """Make the problem whose measurements are the most likely poses of the views, with exact robots."""
    groups = []
    for pair in pairs:
        assert pair.candidates is not None
        weight = np.repeat(pair.weight[:, None], 6, axis=1)
        measurement = PoseMeasurement(pair.candidates[:, 0], weight, weight)
        groups.append(replace(pair.group.without_stops(), measurement=measurement, readings=()))
    columns = sequential_columns({n: problem.column_width(n) for n in problem.columns if n in problem.unknowns})
    return Problem(
        problem.reference, tuple(groups), problem.unknowns, problem.point_mounts, {}, Stops(np.zeros((0, 6))), columns
    )
