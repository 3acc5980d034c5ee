"""OpenCV's hand-eye methods on the same folds: what each predicts of held-out views, beside the answer.

Each method has one moving transform between two unknowns. Of two arms it takes the views in which one of them stands
still, a calibration for each such part, as its users do.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from basecal.accuracy.cross_validation.closed_form_rival import FEWEST_FITTED
from basecal.accuracy.cross_validation.refit import Refit, with_known_stops
from basecal.accuracy.residuals.fit import single_view_pose
from basecal.cell import Rival
from basecal.estimation.problem.view_group import ViewGroup
from basecal.estimation.solve import Solution
from basecal.geometry import SE3, Array, BoolArray, IntArray


@dataclass(frozen=True, eq=False)
class _Part:
    """Views in which one arm moves: `camera_from_target` is `first @ inner @ last` with both unknown.

    Attributes:
        group: The views.
        alone: (n,) `camera_from_target` of each view alone.
        inner: (n,) the moving transform.
    """

    group: ViewGroup
    alone: SE3
    inner: SE3


def opencv_rivals(solution: Solution, refits: Sequence[Refit]) -> tuple[Rival, ...]:
    """The answer and each of OpenCV's seven methods by held-out views; none if both arms move in all views.

    All see the views that the answer uses, through its lens.
    """
    from basecal.vision.robot_world import METHODS, robot_world  # cv2 takes as long to load as all else

    names, errors = ("basecal", *(f"OpenCV {method}" for method in METHODS)), dict[str, list[Array | None]]()
    for part in _parts(solution):
        for refit in refits:
            held = np.isin(part.group.sample, list(refit.held))
            rows, train = np.flatnonzero(held), np.flatnonzero(~held)
            if not len(rows) or len(train) < FEWEST_FITTED:
                continue
            state = with_known_stops(refit.optimum.state, refit.known)
            predicted: list[SE3 | None] = [state.camera_from_target(part.group.take(rows), solution.problem.stops)]
            for method in METHODS:
                found = robot_world(part.alone[train], part.inner[train], method)
                predicted.append(None if found is None else found.first @ part.inner[rows] @ found.last)
            for name, pose in zip(names, predicted, strict=True):
                off = None if pose is None else (part.alone[rows].inverse() @ pose).log()
                errors.setdefault(name, []).append(off)
    return tuple(_rival(name, found) for name, found in errors.items())


def _parts(solution: Solution) -> Iterator[_Part]:
    for group in solution.problem.groups:
        predicted = solution.state.camera_from_target(group, solution.problem.stops)
        alone, free = single_view_pose(solution.state, group, predicted)
        for moving, still in ((0, 1), (1, 0)):
            for rows in _still_views(group, moving, still, free):
                free = free & ~np.isin(np.arange(len(group)), rows)
                recorded = group.ends[moving].base_from_flange[rows]
                inner = recorded.inverse() if moving == 0 else recorded
                yield _Part(group.take(rows), alone[rows], inner)


def _still_views(group: ViewGroup, moving: int, still: int, free: BoolArray) -> Iterator[IntArray]:
    """Rows of views in which one end stands still while the other makes more than a few stops."""
    where, stops = group.ends[still].stand, group.ends[moving].stand
    for place in np.unique(where[free]):
        rows = np.flatnonzero(free & (where == place))
        if len(np.unique(stops[rows])) > FEWEST_FITTED:
            yield rows


def _rival(name: str, errors: Sequence[Array | None]) -> Rival:
    """A method by its errors, (n, 6) [m, rad] of each fold; without an error where it fails in one."""
    if any(each is None for each in errors):
        return Rival(name)
    off = np.concatenate([each for each in errors if each is not None])
    length, angle = (float(np.sqrt(np.mean(np.sum(half**2, axis=1)))) for half in (off[:, :3], off[:, 3:]))
    return Rival(name, length, angle)
