"""Linear mixed model of a problem: its second-order expansion about a state, with unstated variances.

Each view has one cost, gradient and information matrix per sigma, with respect to `camera_from_target` and the lens.
Adjoints relate them to the unknowns and to the errors of stops. The estimation of sigmas therefore needs only sums over
views, whose size does not grow with the number of points. Stops that share views with few other stops form a block
with them. The columns are the unknowns, the errors of all other stops, shared errors, and shapes of targets.
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
        return Moments(*(getattr(self, moment.name) + getattr(other, moment.name) for moment in fields(self)))


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
        layout, count = self.layout, len(self.robot_of_stop)
        errors_of_stops = np.zeros((count, 6))
        for stop in range(count):
            if layout.block[stop] >= 0:
                errors_of_stops[stop] = errors[layout.block[stop], layout.row[stop] : layout.row[stop] + 6]
            else:
                errors_of_stops[stop] = columns[layout.column[stop] : layout.column[stop] + 6]
        for robot in set(self.robot_of_stop):
            stops = [k for k, name in enumerate(self.robot_of_stop) if name == robot]
            for places, by_stop in layout.shared_columns(robot):
                errors_of_stops[stops] += by_stop @ columns[places]
        return errors_of_stops


GroupEstimates = Sequence[Mapping[str, ViewEstimates]]
"""Results of `view_estimates`, by group."""


def make_estimates(problem: Problem, state: State) -> GroupEstimates:
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
    shared_errors: Sequence[Mapping[str, SharedErrors]] = (),
    estimates: GroupEstimates | None = None,
) -> MixedModel:
    """Return the mixed model of a problem about a state.

    Args:
        problem: The problem; stops of `robots` have unit sigmas, so that their errors are in metres and radians.
        state: The state.
        robots: Robots whose sigmas are to be estimated.
        shared_errors: Shared errors by robot, one mapping for each kind.
        estimates: Result of `make_estimates` for the problem and the state; None to compute it.
    """
    layout = place_effects(problem, shared_errors)
    estimates = make_estimates(problem, state) if estimates is None else estimates
    parts: dict[tuple[str, str], Moments] = {}
    white: dict[tuple[str, str], tuple[float, float]] = {}
    for number, group in enumerate(problem.groups):
        for name, view in estimates[number].items():
            key = (group.camera, name)
            moments = _moments(problem, number, state, view, layout)
            parts[key] = moments if key not in parts else parts[key] + moments
            white_before = white.get(key, (0.0, 0.0))
            white[key] = (white_before[0] + view.white, white_before[1] + view.white_count)
    if problem.tied is not None:
        parts[SCENE, STATED] = _scene_moments(problem, problem.tied, state, layout)
    prior, gradient, cost = _prior(problem, state, layout)
    open_views = sorted(key for key in parts if key[1] != STATED)
    sigmas = SigmaPlaces.sequential(open_views, robots, open_jitter(problem), len(shared_errors))
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
    jacobian, columns = unknown_jacobian(problem, group, links, state, rows)
    fixed[:, :, columns] = jacobian
    errors, displacement = np.zeros((n, rows, layout.rows)), np.zeros((n, rows))
    block = np.full(n, -1, dtype=np.int64)
    noisy = [end for end in group.ends if end.has_noise]
    for end, (stop, by_error) in zip(
        noisy, stop_error_jacobians(group, links, state, problem.stops, rows), strict=True
    ):
        displacement += (by_error @ state.stop_errors[stop][..., None])[..., 0]
        _place_stop_errors(fixed, errors, block, stop, by_error, layout)
        for shared_columns, by_stop in layout.shared_columns(end.robot or ""):
            fixed[:, :, shared_columns] += by_error @ by_stop[end.stop_number]
    _place_jitter(errors, block, problem, number, layout)
    weighted = (view.information[..., :rows] @ displacement[..., None])[..., 0]
    gradient = view.gradient - weighted
    squares = np.vecdot(displacement, (weighted - 2 * view.gradient)[:, :rows])
    centred = replace(view, cost=view.cost + squares, gradient=gradient)
    return _sum_views(centred, fixed, errors, block, layout, by_shape)


def _scene_moments(problem: Problem, scene: TiedViews, state: State, layout: Layout) -> Moments:
    """Moments of the static scene; the errors of its stops are all among the columns."""
    equations = linearise_scene(problem, scene, state)
    fixed = np.zeros((len(equations.gradient), layout.width))
    fixed[:, : problem.width] = equations.by_unknowns
    fixed[:, (layout.column[scene.stops, None] + np.arange(6)).ravel()] = equations.by_errors
    for group in scene.groups:
        for shared_columns, shared in layout.shared_columns((group.eye.has_noise and group.eye.robot) or ""):
            stop, first = np.unique(group.eye.stop, return_index=True)
            by_error = equations.by_errors.reshape(len(fixed), -1, 6)[:, np.searchsorted(scene.stops, stop)]
            jacobian = np.einsum("qkc,kcs->qs", by_error, shared[group.eye.stop_number[first]])
            fixed[:, shared_columns] += jacobian
    displacement = equations.by_errors @ state.stop_errors[scene.stops].ravel()
    weighted = equations.information @ displacement
    cost = float(equations.cost + displacement @ (weighted - 2 * equations.gradient))
    b, q, m = layout.blocks, layout.rows, layout.width
    errors = np.zeros((b, q)), np.zeros((b, q, m)), np.zeros((b, q, q))
    information = fixed.T @ equations.information @ fixed
    return Moments(scene.count, cost, fixed.T @ (equations.gradient - weighted), errors[0], information, *errors[1:])


def _place_jitter(errors: Array, block: IntArray, problem: Problem, number: int, layout: Layout) -> None:
    """Write the derivative of views with respect to timing jitter: per second if it is unstated, else per sigma."""
    group, (own_block, row) = problem.groups[number], layout.jitter_rows[number]
    views = np.flatnonzero(own_block >= 0)
    if len(views):
        motion = group.motion if group.camera in problem.open_jitter else problem.jitter_motion(group)
        assert motion is not None
        errors[views, :6, row[views]] = motion[views]
        block[views] = own_block[views]


def _place_stop_errors(
    fixed_effects: Array, errors: Array, block: IntArray, stop: IntArray, by_error: Array, layout: Layout
) -> None:
    """Add the derivative with respect to a robot's stop errors to the columns, or to rows of the views' blocks."""
    for row in range(0, layout.rows - 5, 6):
        views = np.flatnonzero((layout.block[stop] >= 0) & (layout.row[stop] == row))
        errors[views, :, row : row + 6] += by_error[views]
        block[views] = layout.block[stop[views]]
    for view in np.flatnonzero(layout.column[stop] >= 0):
        first = layout.column[stop[view]]
        fixed_effects[view, :, first : first + 6] += by_error[view]


def _sum_views(
    view: ViewEstimates, fixed_effects: Array, errors: Array, block: IntArray, layout: Layout, by_shape: slice | None
) -> Moments:
    """Sum the moments of views; the many columns of a shape are copied, since their Jacobian is the identity."""
    n, rows, _ = fixed_effects.shape
    gradient, information = view.gradient[:, :rows], view.information[:, :rows, :rows]
    weighted = information @ fixed_effects
    if by_shape is not None:
        weighted[..., by_shape] = view.information[:, :rows, rows:]
    flat = fixed_effects.reshape(n * rows, layout.width)
    by_fixed, fixed_fixed = flat.T @ gradient.ravel(), flat.T @ weighted.reshape(n * rows, layout.width)
    if by_shape is not None:
        by_fixed[by_shape] = view.gradient[:, rows:].sum(0)
        fixed_fixed[by_shape] = fixed_fixed[:, by_shape].T
        fixed_fixed[by_shape, by_shape] = view.information[:, rows:, rows:].sum(0)
    blocks, q, m = layout.blocks, layout.rows, layout.width
    e, ef, ee = np.zeros((blocks, q)), np.zeros((blocks, q, m)), np.zeros((blocks, q, q))
    for chunk, used_rows in layout.chunks(m):
        views = np.flatnonzero((block >= chunk.start) & (block < chunk.stop))
        by_error = errors[views, :, used_rows].mT
        sums = GroupSums(block[views] - chunk.start, chunk.stop - chunk.start)
        e[chunk, used_rows] = sums.sum((by_error @ gradient[views][..., None])[..., 0])
        ef[chunk, used_rows] = sums.sum(by_error @ weighted[views])
        ee[chunk, used_rows, used_rows] = sums.sum(by_error @ information[views] @ errors[views, :, used_rows])
    return Moments(view.count, float(view.cost.sum()), by_fixed, e, fixed_fixed, ef, ee)


def _prior(problem: Problem, state: State, layout: Layout) -> tuple[Array, Array, float]:
    information, unknown_gradient, unknown_cost = prior_equations(problem, state)
    prior, gradient, cost = np.eye(layout.width), np.zeros(layout.width), float(unknown_cost)
    prior[: problem.width, : problem.width], gradient[: problem.width] = information, unknown_gradient
    for target, columns in layout.shapes.items():
        mean = problem.shapes.get(target, np.zeros(columns.stop - columns.start))
        gradient[columns] = mean
        cost += float(mean @ mean)
    return prior, gradient, cost


def _sigma_indices(problem: Problem, layout: Layout, sigmas: SigmaPlaces) -> tuple[IntArray, IntArray]:
    """Indices of the sigmas of columns and of errors in blocks; see `MixedModel`."""
    column = np.full(layout.width, -1, dtype=np.int64)
    error = np.full((layout.blocks, layout.rows), -1, dtype=np.int64)
    sigma_of_robot = {robot: place.start for robot, place in sigmas.stops.items()}
    first_sigma = np.array([sigma_of_robot.get(robot, -1) for robot in problem.stops.robot], dtype=np.int64)
    sigma_index, axes = first_sigma[:, None] + np.repeat([0, 1], 3), np.arange(6)
    tied, hub = ((first_sigma >= 0) & (place >= 0) for place in (layout.block, layout.column))
    error[layout.block[tied, None], layout.row[tied, None] + axes] = sigma_index[tied]
    column[layout.column[hub, None] + axes] = sigma_index[hub]
    for group, (block, row) in zip(problem.groups, layout.jitter_rows, strict=True):
        if group.camera in sigmas.jitter:
            error[block[block >= 0], row[block >= 0]] = sigmas.jitter[group.camera]
    for columns, places in zip(layout.shared, sigmas.shared, strict=True):
        for robot, (column_start, errors) in columns.items():
            column[column_start : column_start + len(errors.is_turn)] = places[robot].start + errors.is_turn
    return column, error
