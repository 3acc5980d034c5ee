"""Comparison of the solution with closed-form hand-eye calibration from the poses of single views.

Closed forms do not model noise, priors or outliers. If one still predicts held-out views better, the model of the
solution is wrong in a way that no other finding reports.
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

_MIN_VIEWS = 6  # smallest number of held-out views for a comparison; assumed
FEWEST_FITTED = 3
"""Smallest number of fitted views: they give the two motions that a closed form needs (Tsai & Lenz 1989)."""
_LEAST_ERROR = np.array([1e-5, 1e-5])  # [m, rad] lower bound of held-out errors: half of the best arms' stated 0.02 mm

Triple = tuple[SE3, SE3, SE3]


@dataclass(frozen=True, eq=False)
class ClosedFormRival:
    """A closed form that predicts held-out views better than the solution.

    Attributes:
        ratio: Held-out error of the solution over that of the closed form, with lengths and angles in units of the
            solution's errors.
        moved: (p,) step from the solution to the closed form in the solution's columns.
    """

    ratio: float
    moved: Array


def closed_form_rival(solution: Solution, refits: Sequence[Refit]) -> ClosedFormRival | None:
    """Compare the solution with the closed form of the only pair of camera and target, on held-out views.

    Both predict the views of a fold with the lens of that fold.

    Returns:
        The closed form if it predicts significantly better; else None, also if there are several pairs.
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
    ratio = _error_ratio(np.concatenate(ours), np.concatenate(theirs)) if ours else None
    whole = _closed_form(solution.problem, group, *of_all)
    if ratio is None or whole is None:
        return None
    return ClosedFormRival(ratio, _closed_form_step(solution.problem, solution.state, group, whole))


def _closed_form(problem: Problem, group: ViewGroup, poses: SE3, mask: BoolArray) -> Triple | None:
    """Solve X, Y and Z from the views of a mask; None if their rotations are not determined."""
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
    """Squared translation [m^2] and rotation [rad^2] errors of predictions, (n, 2)."""
    off = poses.inverse() @ predictions
    return np.stack([np.sum(off.translation**2, axis=1), np.sum(off.rotvec**2, axis=1)], axis=1)


def _error_ratio(ours: Array, theirs: Array) -> float | None:
    """Held-out error of the solution over that of the closed form; None if the closed form is not clearly better."""
    if len(ours) < _MIN_VIEWS or not np.all(np.isfinite(theirs)):
        return None
    ours, theirs = np.maximum(ours, _LEAST_ERROR**2), np.maximum(theirs, _LEAST_ERROR**2)
    unit = ours.mean(0)
    of_closed_form, of_solution = (theirs / unit).sum(1), (ours / unit).sum(1)
    is_taken = compare_predictions(of_closed_form, of_solution).is_taken
    return float(np.sqrt(of_solution.mean() / of_closed_form.mean())) if is_taken else None


def _closed_form_step(problem: Problem, state: State, group: ViewGroup, triple: Triple) -> Array:
    """Step from the solution to the closed form in the columns of transforms, (p,); 0 in all other columns."""
    x, y, z = triple
    placed = group.placed_base(y, state.transforms, problem.columns)
    found = {group.eye.mount: x, group.hand.mount: z} | placed
    return state_step(problem, state, replace(state, transforms={**state.transforms, **found}))


@dataclass(frozen=True, eq=False)
class _Part:
    """Views in which only one arm moves: `camera_from_target` is `first @ inner @ last` with unknown first and last.

    Attributes:
        group: The views.
        alone: (n,) `camera_from_target` estimated from each view alone.
        inner: (n,) the moving transform.
    """

    group: ViewGroup
    alone: SE3
    inner: SE3


def opencv_rivals(solution: Solution, refits: Sequence[Refit]) -> tuple[Rival, ...]:
    """Held-out errors of the solution and of each of OpenCV's seven methods; empty if both arms move in all views.

    Each method has one moving transform between two unknowns. With two arms, it uses the views in which one arm does
    not move. Each such part is a separate calibration, as users of these methods do.

    All methods use the inlier views and the lens of the solution.
    """
    from basecal.vision.robot_world import METHODS, robot_world  # importing cv2 takes as long as all other imports

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
    """Yield rows of views in which one end does not move, and the other end has more than `FEWEST_FITTED` stops."""
    places, stops = group.ends[still].stop_number, group.ends[moving].stop_number
    for place in np.unique(places[free]):
        rows = np.flatnonzero(free & (places == place))
        if len(np.unique(stops[rows])) > FEWEST_FITTED:
            yield rows


def _rival(name: str, errors: Sequence[Array | None]) -> Rival:
    """Rms errors of a method from its errors in each fold, (n, 6) [m, rad]; errors are None if it fails in a fold."""
    if any(each is None for each in errors):
        return Rival(name)
    off = np.concatenate([each for each in errors if each is not None])
    length, angle = (float(np.sqrt(np.mean(np.sum(half**2, axis=1)))) for half in (off[:, :3], off[:, 3:]))
    return Rival(name, length, angle)
