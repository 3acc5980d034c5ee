"""A floor under the answer: closed forms of single views' poses, as hand-eye calibration has them elsewhere.

They know nothing of noise, priors or outliers. Where they predict held-out views better all the same, the model of the
answer is wrong in a way that no finding has named.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from basecal.accuracy.cross_validation.refit import Refit, with_known_stops
from basecal.accuracy.model_comparison.held_out import compare_predictions
from basecal.accuracy.residuals.fit import single_view_pose
from basecal.estimation.problem.problem import Problem, State
from basecal.estimation.problem.view_group import ViewGroup
from basecal.estimation.solve import Solution
from basecal.estimation.start.closed_form import Loop, solve_rotations, solve_translations
from basecal.geometry import SE3, Array, BoolArray

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
    bases = [SE3.identity() if end.base is None else _fixed_mean(problem, end.base) for end in group.ends]
    y = None if bases[0] is None or bases[1] is None else bases[0].inverse() @ bases[1]
    x, z = (_fixed_mean(problem, end.mount) for end in group.ends)
    a, c = (end.base_from_flange[rows] for end in group.ends)
    loop = Loop(a, poses[rows], c, x, y, z, np.ones(len(rows)))
    if not loop.unknown:
        return None
    try:
        rotations = solve_rotations(loop)
        return solve_translations(loop, rotations) if rotations.clear else None
    except np.linalg.LinAlgError:
        return None


def _fixed_mean(problem: Problem, name: str) -> SE3 | None:
    unknown = problem.unknowns[name]
    return unknown.mean if unknown.status == "fixed" else None


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
    is_taken = compare_predictions("closed form", squares, in_use).is_taken
    return float(np.sqrt(in_use.mean() / squares.mean())) if is_taken else None


def _closed_form_step(problem: Problem, state: State, group: ViewGroup, triple: Triple) -> Array:
    """The step from the answer to the closed form in the columns of transforms, (p,); 0 in all others."""
    x, y, z = triple
    placed = group.placed_base(y, state.transforms, problem.columns)
    found = {group.eye.mount: x, group.hand.mount: z} | placed
    step = np.zeros(problem.width)
    for name, transform in found.items():
        if name in problem.columns:
            where = problem.columns[name]
            step[where] = (state.transforms[name].inverse() @ transform).log()[: where.stop - where.start]
    return step
