"""Linear mixed model of a problem: its second-order expansion about a state, with unstated variances.

Each view has one cost, gradient and information matrix per sigma, with respect to `camera_from_target` and the lens.
Adjoints relate them to the unknowns and to the errors of stops. The estimation of sigmas therefore needs only sums over
views, whose size does not grow with the number of points. Stops that views link to few others form a block with these.
The columns are the unknowns, the errors of stops linked to many others, shared errors, and shapes of targets.
Source: Harville 1977; docs/mathematics.md (5.2).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace

import numpy as np

from basecal.effects.faces.shared_errors import SharedErrors
from basecal.effects.target_shape import unit_shifts
from basecal.estimation.least_squares.jacobians import stop_error_jacobians, unknown_jacobian
from basecal.estimation.least_squares.normal_equations import prior_equations
from basecal.estimation.least_squares.tied_equations import linearise_scene
from basecal.estimation.noise.layout import Layout, place_effects
from basecal.estimation.noise.shaped_targets import shaped_points, shaped_targets
from basecal.estimation.noise.sigma_places import SigmaPlaces
from basecal.estimation.noise.view_estimates import STATED, ViewEstimates, view_estimates
from basecal.estimation.problem.problem import Problem, State, chain
from basecal.estimation.problem.tied_views import SCENE, TiedViews
from basecal.geometry import Array, IntArray
from basecal.numerics.group_sums import GroupSums


@dataclass(frozen=True, eq=False)
class Moments:
    """Sums over views of the terms that one sigma scales, at unit sigma.

    Attributes:
        count: Degrees of freedom.
        cost: Cost at the state, with zero errors of stops.
        fixed: (m,) gradient with respect to the columns.
        errors: (b, q) gradient with respect to the errors in blocks.
        fixed_fixed: (m, m) information of the columns.
        errors_fixed: (b, q, m) information of errors and columns.
        errors_errors: (b, q, q) information of the errors of each block.
    """

    count: float
    cost: float
    fixed: Array
    errors: Array
    fixed_fixed: Array
    errors_fixed: Array
    errors_errors: Array

    def __add__(self, other: Moments) -> Moments:
        return Moments(*(getattr(self, of.name) + getattr(other, of.name) for of in fields(self)))


@dataclass(frozen=True, eq=False)
class MixedModel:
    """Second-order model of a problem about a state.

    Attributes:
        parts: Moments by camera and the field of `Noise` that scales them; the field is `STATED` for stated sigmas.
        width: Number of columns that are unknowns of the problem; the others are random effects.
        prior: (m, m) prior information of the columns, the identity for random effects.
        prior_gradient: (m,) gradient of the prior.
        prior_cost: Cost of the prior.
        sigmas: Indices of the unstated sigmas in the vector of their logarithms.
        of_columns: (m,) index of the sigma that scales each column; -1 for none.
        of_errors: (b, q) index of the sigma that scales each error in blocks; -1 for none.
        white: Sum of squared residuals of points about their view's own estimate, at unit sigma, and its degrees of
            freedom, by the keys of `parts`.
        layout: Positions of the random effects.
        robot_of_stop: Name of the robot of each stop.
    """

    parts: Mapping[tuple[str, str], Moments]
    width: int
    prior: Array
    prior_gradient: Array
    prior_cost: float
    sigmas: SigmaPlaces
    of_columns: IntArray
    of_errors: IntArray
    white: Mapping[tuple[str, str], tuple[float, float]]
    layout: Layout
    robot_of_stop: tuple[str, ...]

    def stop_errors(self, errors: Array, columns: Array) -> Array:
        """Errors of every stop, (k, 6), from the errors in blocks, (b, q), and the values of the columns, (m,)."""
        of, count = self.layout, len(self.robot_of_stop)
        out = np.zeros((count, 6))
        for stop in range(count):
            if of.block[stop] >= 0:
                out[stop] = errors[of.block[stop], of.row[stop] : of.row[stop] + 6]
            else:
                out[stop] = columns[of.column[stop] : of.column[stop] + 6]
        for robot in set(self.robot_of_stop):
            mine = [k for k, name in enumerate(self.robot_of_stop) if name == robot]
            for where, by_stop in of.shared_columns(robot):
                out[mine] += by_stop @ columns[where]
        return out


EstimatesOf = Sequence[Mapping[str, ViewEstimates]]
"""Results of `view_estimates`, by group."""


def make_estimates(problem: Problem, state: State) -> EstimatesOf:
    """Estimate each view alone; the result serves all models of a state, whatever their shared errors."""
    shaped = shaped_targets(problem)
    return [
        view_estimates(
            problem, g, state, unit_shifts(shaped_points(g)) if g.target in shaped and len(shaped_points(g)) else None
        )
        for g in problem.groups
    ]


def mixed_model(
    problem: Problem,
    state: State,
    robots: Sequence[str],
    kinds: Sequence[Mapping[str, SharedErrors]] = (),
    estimates: EstimatesOf | None = None,
) -> MixedModel:
    """Return the mixed model of a problem about a state.

    Args:
        problem: The problem; stops of `robots` have unit sigmas, so that their errors are in metres and radians.
        state: The state.
        robots: Robots whose sigmas are to be estimated.
        kinds: Shared errors by robot, one mapping for each kind.
        estimates: Result of `make_estimates` for the problem and the state; None to compute it.
    """
    layout = place_effects(problem, kinds)
    estimates = make_estimates(problem, state) if estimates is None else estimates
    parts: dict[tuple[str, str], Moments] = {}
    white: dict[tuple[str, str], tuple[float, float]] = {}
    for number, group in enumerate(problem.groups):
        for name, view in estimates[number].items():
            key = (group.camera, name)
            of = _moments(problem, number, state, view, layout)
            parts[key] = of if key not in parts else parts[key] + of
            before = white.get(key, (0.0, 0.0))
            white[key] = (before[0] + view.white, before[1] + view.white_count)
    if problem.tied is not None:
        parts[SCENE, STATED] = _scene_moments(problem, problem.tied, state, layout)
    prior, gradient, cost = _prior(problem, state, layout)
    open_views = sorted(key for key in parts if key[1] != STATED)
    sigmas = SigmaPlaces.sequential(open_views, robots, open_jitter(problem), len(kinds))
    scaled = _sigma_indices(problem, layout, sigmas)
    robot_of_stop = problem.stops.robot
    return MixedModel(parts, problem.width, prior, gradient, cost, sigmas, *scaled, white, layout, robot_of_stop)


def open_jitter(problem: Problem) -> tuple[str, ...]:
    """Cameras with moving views whose timing jitter is to be estimated."""
    moving = {g.camera for g in problem.groups if g.motion is not None and len(g)}
    return tuple(sorted(problem.open_jitter & moving))


def _moments(problem: Problem, number: int, state: State, view: ViewEstimates, layout: Layout) -> Moments:
    group = problem.groups[number]
    links = chain(group, state, problem.stops)
    by_shape = layout.shapes.get(group.target) if len(shaped_points(group)) else None
    n, rows = view.gradient.shape
    rows -= 0 if by_shape is None else by_shape.stop - by_shape.start  # rows of pose and lens
    fixed = np.zeros((n, rows, layout.width))
    of_unknowns, columns = unknown_jacobian(problem, group, links, state, rows)
    fixed[:, :, columns] = of_unknowns
    errors, present = np.zeros((n, rows, layout.rows)), np.zeros((n, rows))
    block = np.full(n, -1, dtype=np.int64)
    noisy = [end for end in group.ends if end.has_noise]
    for end, (stop, by_error) in zip(
        noisy, stop_error_jacobians(group, links, state, problem.stops, rows), strict=True
    ):
        present += (by_error @ state.stop_errors[stop][..., None])[..., 0]
        _place(fixed, errors, block, stop, by_error, layout)
        for where, by_stop in layout.shared_columns(end.robot or ""):
            fixed[:, :, where] += by_error @ by_stop[end.stop_number]
    _place_jitter(errors, block, problem, number, layout)
    carried = (view.information[..., :rows] @ present[..., None])[..., 0]
    gradient = view.gradient - carried
    squares = np.vecdot(present, (carried - 2 * view.gradient)[:, :rows])
    about = replace(view, cost=view.cost + squares, gradient=gradient)
    return _sum_views(about, fixed, errors, block, layout, by_shape)


def _scene_moments(problem: Problem, scene: TiedViews, state: State, layout: Layout) -> Moments:
    """Moments of the static scene; the errors of its stops are all among the columns."""
    about = linearise_scene(problem, scene, state)
    fixed = np.zeros((len(about.gradient), layout.width))
    fixed[:, : problem.width] = about.by_unknowns
    fixed[:, (layout.column[scene.stops, None] + np.arange(6)).ravel()] = about.by_errors
    for group in scene.groups:
        for where, shared in layout.shared_columns((group.eye.has_noise and group.eye.robot) or ""):
            stop, first = np.unique(group.eye.stop, return_index=True)
            by_error = about.by_errors.reshape(len(fixed), -1, 6)[:, np.searchsorted(scene.stops, stop)]
            moved = np.einsum("qkc,kcs->qs", by_error, shared[group.eye.stop_number[first]])
            fixed[:, where] += moved
    present = about.by_errors @ state.stop_errors[scene.stops].ravel()
    carried = about.information @ present
    cost = float(about.cost + present @ (carried - 2 * about.gradient))
    b, q, m = layout.blocks, layout.rows, layout.width
    errors = np.zeros((b, q)), np.zeros((b, q, m)), np.zeros((b, q, q))
    both = fixed.T @ about.information @ fixed
    return Moments(scene.count, cost, fixed.T @ (about.gradient - carried), errors[0], both, *errors[1:])


def _place_jitter(errors: Array, block: IntArray, problem: Problem, number: int, layout: Layout) -> None:
    """Write the derivative of views with respect to timing jitter: per second if it is unstated, else per sigma."""
    group, (own, row) = problem.groups[number], layout.jitter_rows[number]
    here = np.flatnonzero(own >= 0)
    if len(here):
        unit = group.motion if group.camera in problem.open_jitter else problem.jitter_motion(group)
        assert unit is not None
        errors[here, :6, row[here]] = unit[here]
        block[here] = own[here]


def _place(
    fixed_effects: Array, errors: Array, block: IntArray, stop: IntArray, by_error: Array, layout: Layout
) -> None:
    """Add the derivative with respect to a robot's stop errors to the columns, or to rows of the views' blocks."""
    for row in range(0, layout.rows - 5, 6):
        here = np.flatnonzero((layout.block[stop] >= 0) & (layout.row[stop] == row))
        errors[here, :, row : row + 6] += by_error[here]
        block[here] = layout.block[stop[here]]
    for view in np.flatnonzero(layout.column[stop] >= 0):
        at = layout.column[stop[view]]
        fixed_effects[view, :, at : at + 6] += by_error[view]


def _sum_views(
    view: ViewEstimates, fixed_effects: Array, errors: Array, block: IntArray, layout: Layout, by_shape: slice | None
) -> Moments:
    """Sum the moments of views; the many columns of a shape are copied, since their Jacobian is the identity."""
    n, rows, _ = fixed_effects.shape
    gradient, information = view.gradient[:, :rows], view.information[:, :rows, :rows]
    carried = information @ fixed_effects
    if by_shape is not None:
        carried[..., by_shape] = view.information[:, :rows, rows:]
    flat = fixed_effects.reshape(n * rows, layout.width)
    by_fixed, both = flat.T @ gradient.ravel(), flat.T @ carried.reshape(n * rows, layout.width)
    if by_shape is not None:
        by_fixed[by_shape] = view.gradient[:, rows:].sum(0)
        both[by_shape] = both[:, by_shape].T
        both[by_shape, by_shape] = view.information[:, rows:, rows:].sum(0)
    blocks, q, m = layout.blocks, layout.rows, layout.width
    e, ef, ee = np.zeros((blocks, q)), np.zeros((blocks, q, m)), np.zeros((blocks, q, q))
    for some, used in layout.chunks(m):
        here = np.flatnonzero((block >= some.start) & (block < some.stop))
        by_error = errors[here, :, used].mT
        sums = GroupSums(block[here] - some.start, some.stop - some.start)
        e[some, used] = sums.sum((by_error @ gradient[here][..., None])[..., 0])
        ef[some, used] = sums.sum(by_error @ carried[here])
        ee[some, used, used] = sums.sum(by_error @ information[here] @ errors[here, :, used])
    return Moments(view.count, float(view.cost.sum()), by_fixed, e, both, ef, ee)


def _prior(problem: Problem, state: State, layout: Layout) -> tuple[Array, Array, float]:
    known, of_unknowns, total = prior_equations(problem, state)
    prior, gradient, cost = np.eye(layout.width), np.zeros(layout.width), float(total)
    prior[: problem.width, : problem.width], gradient[: problem.width] = known, of_unknowns
    for target, columns in layout.shapes.items():
        mean = problem.shapes.get(target, np.zeros(columns.stop - columns.start))
        gradient[columns] = mean
        cost += float(mean @ mean)
    return prior, gradient, cost


def _sigma_indices(problem: Problem, layout: Layout, sigmas: SigmaPlaces) -> tuple[IntArray, IntArray]:
    """Indices of the sigmas of columns and of errors in blocks; see `MixedModel`."""
    column = np.full(layout.width, -1, dtype=np.int64)
    error = np.full((layout.blocks, layout.rows), -1, dtype=np.int64)
    first = {robot: place.start for robot, place in sigmas.stops.items()}
    of_robot = np.array([first.get(robot, -1) for robot in problem.stops.robot], dtype=np.int64)
    which, six = of_robot[:, None] + np.repeat([0, 1], 3), np.arange(6)
    tied, hub = ((of_robot >= 0) & (at >= 0) for at in (layout.block, layout.column))
    error[layout.block[tied, None], layout.row[tied, None] + six] = which[tied]
    column[layout.column[hub, None] + six] = which[hub]
    for group, (own, row) in zip(problem.groups, layout.jitter_rows, strict=True):
        if group.camera in sigmas.jitter:
            error[own[own >= 0], row[own >= 0]] = sigmas.jitter[group.camera]
    for columns, places in zip(layout.shared, sigmas.shared, strict=True):
        for robot, (at, errors) in columns.items():
            column[at : at + len(errors.is_turn)] = places[robot].start + errors.is_turn
    return column, error
