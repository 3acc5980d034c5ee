"""A floor under the answer: closed forms of single views' poses, as hand-eye calibration has them elsewhere.

They know nothing of noise, priors or outliers. Where they predict held-out views better all the same, the model of the
answer is wrong in a way that no finding has named.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from basecal.accuracy.covariance.widening import state_step
from basecal.accuracy.cross_validation.refit import Refit, with_known_stops
from basecal.accuracy.model_comparison.held_out import compare_predictions
from basecal.accuracy.residuals.fit import single_view_pose
from basecal.cell import Rival
from basecal.estimation.problem.problem import Problem, State
from basecal.estimation.problem.view_group import ViewGroup
from basecal.estimation.solve import Solution
from basecal.estimation.start.closed_form import Loop, solve_rotations, solve_translations
from basecal.geometry import SE3, Array, BoolArray, IntArray

_MIN_VIEWS = 6  # held-out views that are compared; assumed
FEWEST_FITTED = 3
"""Views of a part that is fitted, which make the two motions that a closed form needs (Tsai & Lenz 1989)."""
_SMALLEST = np.array([1e-5, 1e-5])  # [m, rad] of held-out errors: half of what makers state of the best arms, 0.02 mm

Triple = tuple[SE3, SE3, SE3]


@dataclass(frozen=True, eq=False)
class ClosedFormRival:
    """A closed form that predicts held-out views better than the answer does.

    Attributes:
        ratio: Held-out error of the answer over its, angles and lengths in units of the answer's.
        moved: (p,) by how much the answer's columns would move to be the closed form's.
    """

    ratio: float
    moved: Array


def closed_form_rival(solution: Solution, refits: Sequence[Refit]) -> ClosedFormRival | None:
    """The closed form of the only pair of camera and target, where it predicts better beyond chance; else None.

    Both see the views of a fold through the lens of that fold.
    """
    if len(solution.problem.groups) != 1:
        return None
    (group,) = solution.problem.groups
    predicted = solution.state.camera_from_target(group, solution.problem.stops)
    alone, enough = of_all = single_view_pose(solution.state, group, predicted)
    ours, theirs = [], []
    for refit in refits:
        if group.camera in solution.problem.columns:
            alone, enough = single_view_pose(refit.optimum.state, group, predicted)
        held = np.isin(group.sample, list(refit.held)) & enough
        triple = _closed_form(solution.problem, group, alone, enough & ~held)
        if triple is None:
            return None
        rows = np.flatnonzero(held)
        views, (x, y, z) = group.take(rows), triple
        state = with_known_stops(refit.optimum.state, refit.known)
        ours.append(_squared_errors(alone[rows], state.camera_from_target(views, solution.problem.stops)))
        theirs.append(_squared_errors(alone[rows], views.close_loop(x, y, z)))
    ratio = _ratio(np.concatenate(ours), np.concatenate(theirs)) if ours else None
    whole = _closed_form(solution.problem, group, *of_all)
    if ratio is None or whole is None:
        return None
    return ClosedFormRival(ratio, _closed_form_step(solution.problem, solution.state, group, whole))


def _closed_form(problem: Problem, group: ViewGroup, poses: SE3, mask: BoolArray) -> Triple | None:
    """X, Y and Z by the views of a mask; None where their rotations are not determined."""
    rows = np.flatnonzero(mask)
    if len(rows) < FEWEST_FITTED:
        return None
    a, c = (end.base_from_flange[rows] for end in group.ends)
    loop = Loop(a, poses[rows], c, *problem.fixed_factors(group), np.ones(len(rows)))
    if not loop.unknown:
        return None
    try:
        rotations = solve_rotations(loop)
        return solve_translations(loop, rotations) if rotations.clear else None
    except np.linalg.LinAlgError:
        return None


def _squared_errors(poses: SE3, predictions: SE3) -> Array:
    """Squares of lengths [m^2] and of angles [rad^2], (n, 2)."""
    off = poses.inverse() @ predictions
    return np.stack([np.sum(off.translation**2, axis=1), np.sum(off.rotvec**2, axis=1)], axis=1)


def _ratio(ours: Array, theirs: Array) -> float | None:
    """Held-out error of the answer over the rival's; None if that is no clear gain, or may be chance."""
    if len(ours) < _MIN_VIEWS or not np.all(np.isfinite(theirs)):
        return None
    ours, theirs = np.maximum(ours, _SMALLEST**2), np.maximum(theirs, _SMALLEST**2)
    unit = ours.mean(0)
    squares, in_use = (theirs / unit).sum(1), (ours / unit).sum(1)
    is_taken = compare_predictions(squares, in_use).is_taken
    return float(np.sqrt(in_use.mean() / squares.mean())) if is_taken else None


def _closed_form_step(problem: Problem, state: State, group: ViewGroup, triple: Triple) -> Array:
    """The step from the answer to the closed form in the columns of transforms, (p,); 0 in all others."""
    x, y, z = triple
    placed = group.placed_base(y, state.transforms, problem.columns)
    found = {group.eye.mount: x, group.hand.mount: z} | placed
    return state_step(problem, state, replace(state, transforms={**state.transforms, **found}))


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

    Each method has one moving transform between two unknowns. Of two arms it takes the views in which one of them
    stands still, a calibration for each such part, as its users do.

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
