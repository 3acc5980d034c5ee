"""Normal equations of a whole problem, with the robots' pose errors eliminated.

H and g are the information and gradient of a view, D the derivative of its `camera_from_target` with respect to the
unknowns. The sums over views are sum D'HD and sum D'g. J is the derivative of a view with respect to the stop errors
u, in sigmas. A private stop has a single view and is eliminated in it. With S = JJ', this yields H' = (I + H S)^-1 H
and g' = (I + H S)^-1 (g - H J u). The 6-vectors of shared stops are eliminated by the Schur complement.
Source: docs/mathematics.md (4.1)-(4.3).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from basecal.cell import Unknown
from basecal.estimation.least_squares.jacobians import stop_error_jacobians, unknown_jacobian
from basecal.estimation.least_squares.schur_complement import SchurAccumulator, SchurComplement, StopViews
from basecal.estimation.least_squares.tied_equations import linearise_scene
from basecal.estimation.problem.problem import Problem, State, chain
from basecal.estimation.problem.robot_parameters import apply_step, column_values
from basecal.estimation.problem.view_group import ViewGroup
from basecal.estimation.view.common_error import without_motion
from basecal.estimation.view.measurement import ViewInformation
from basecal.geometry import SE3, Array, BoolArray, Camera, IntArray
from basecal.geometry.se3_jacobians import right_jacobian_inverse
from basecal.numerics.batch import SHARED
from basecal.numerics.inverse_factors import inverse_factors

_ROUNDING_SCALE = 1e14  # an identity that is added to an entry of this size is lost in rounding
_ROUNDING = 1e-15  # share of such entries that is added to keep the matrix regular
_GAUGE_SIGMA = 1e-5  # [m, rad] prior of gauge directions, arbitrary
_MANY_SYSTEMS = 64  # number of systems from which a batched factorisation is faster


@dataclass(frozen=True, eq=False)
class LinearisedViews:
    """Second-order expansion of a group's views, with private stops eliminated.

    Attributes:
        gradient: (..., n, q).
        information: (..., n, q, q).
        eliminated_cost: (..., n) decrease of the cost by the optimal step of the private stops' errors alone.
        by_unknowns: (..., n, q, m) derivative of the views with respect to the unknowns.
        columns: (m,) columns of these unknowns in the problem.
        private: Views at stops of a single view.
        shared: Views at stops of several views.
    """

    gradient: Array
    information: Array
    eliminated_cost: Array
    by_unknowns: Array
    columns: IntArray = field(metadata=SHARED)
    private: tuple[StopViews, ...]
    shared: tuple[StopViews, ...]

    @property
    def private_error_jacobian(self) -> Array:
        """Derivative of the views with respect to the errors of their private stops, (n, q, 6 k)."""
        derivative = np.zeros((*self.gradient.shape, 6 * len(self.private)))
        for k, part in enumerate(self.private):
            derivative[part.view, :, 6 * k : 6 * k + 6] = part.by_error
        return derivative

    def weigh(self, weight: Array) -> LinearisedViews:
        """Scale the information of each view by its weight, (..., n); views of weight zero may be non-finite."""
        gradient, information = self.gradient * weight[..., None], self.information * weight[..., None, None]
        eliminated_cost = self.eliminated_cost * weight
        if not weight.all():
            seen = weight > 0
            gradient = np.where(seen[..., None], gradient, 0.0)
            information = np.where(seen[..., None, None], information, 0.0)
            eliminated_cost = np.where(seen, eliminated_cost, 0.0)
        return replace(self, gradient=gradient, information=information, eliminated_cost=eliminated_cost)


@dataclass(frozen=True, eq=False)
class NormalEquations:
    """Second-order expansion of the problem about a state, or about each state of a batch.

    Attributes:
        cost: (...) sum of squared residuals in sigmas, including priors and stop errors.
        gradient: (..., p) half the derivative of the cost, with optimal stop errors.
        hessian: (..., p, p) half the second derivative of the cost, with optimal stop errors.
        eliminated_cost: (...) decrease of the cost by the optimal step of the stop errors alone.
        stop_log_det: (...) log determinant of the information of the eliminated stop errors.
        views: Linearised views by group, for `retract`.
        system: Schur complement of the shared stops; None if there are none.
    """

    cost: Array
    gradient: Array
    hessian: Array
    eliminated_cost: Array
    stop_log_det: Array
    views: tuple[LinearisedViews, ...]
    system: SchurComplement | None


def linearise(problem: Problem, state: State, weights: Sequence[Array] | None = None) -> NormalEquations:
    """Expand the problem to second order at a state; the cost is infinite if a visible point is behind its camera.

    Args:
        problem: The problem.
        state: The state, or a batch of states.
        weights: Weights of views and of their private stops' errors, (..., n) by group; all 1 if None.
    """
    hessian, gradient, cost = prior_equations(problem, state)
    cost += np.sum(state.stop_errors**2, axis=(-1, -2))
    eliminated, log_det, views, weighted = np.zeros(state.batch), np.zeros(state.batch), [], []
    for number, group in enumerate(problem.groups):
        view_costs, group_log_det, linearised = _linearise_group(problem, group, state)
        log_det += group_log_det
        views.append(linearised)
        if weights is not None:
            cost += _private_cost(linearised, state, weights[number])
            view_costs = np.where(weights[number] > 0, view_costs, 0.0) * weights[number]
            linearised = linearised.weigh(weights[number])
        cost += view_costs.sum(-1)
        eliminated += linearised.eliminated_cost.sum(-1)
        weighted.append(linearised)
    scene_cost, hessian, gradient, system = sum_views(problem, state, weighted, hessian, gradient)
    cost += scene_cost
    if system is not None:
        eliminated += system.eliminated_cost
        log_det += system.log_det
    return NormalEquations(cost, gradient, hessian, eliminated, log_det, tuple(views), system)


def sum_views(
    problem: Problem, state: State, views: Sequence[LinearisedViews], hessian: Array, gradient: Array
) -> tuple[Array | float, Array, Array, SchurComplement | None]:
    """Sum the normal equations over views and the static scene, and eliminate the shared stops.

    Args:
        problem: The problem.
        state: The state, or a batch of states.
        views: Linearised views, by group.
        hessian: (..., c, c) of the priors; the unknowns are the first columns; modified in place.
        gradient: (..., c) of the priors; modified in place.

    Returns:
        Cost of the static scene; Hessian, (..., c, c); gradient, (..., c); Schur complement of the shared stops, None
        if there are none.
    """
    cost: Array | float = 0.0
    shared = problem.shared_stops >= 0
    sums = SchurAccumulator(state.stop_errors[..., shared, :], hessian.shape[-1]) if np.any(shared) else None
    for part in views:
        if sums is not None:
            sums.add(part.shared, part.gradient, part.information, part.by_unknowns, part.columns)
        *batch, count, rows, width = part.by_unknowns.shape
        flat = part.by_unknowns.reshape(*batch, count * rows, width)
        weighted = (part.information @ part.by_unknowns).reshape(flat.shape)
        derivative_t = flat.mT
        hessian[..., part.columns[:, None], part.columns] += derivative_t @ weighted
        gradient[..., part.columns] += (derivative_t @ part.gradient.reshape(*flat.shape[:-1], 1))[..., 0]
    if problem.tied is not None:
        scene_equations = linearise_scene(problem, problem.tied, state)
        cost = scene_equations.cost
        scene_equations.add(hessian, gradient, problem, sums)
    system = None if sums is None else sums.solve()
    if system is not None:
        hessian, gradient = system.reduce(hessian, gradient)
    return cost, 0.5 * (hessian + hessian.mT), gradient, system


def retract(problem: Problem, state: State, normal: NormalEquations, step: Array) -> State:
    """Return the state after a step of the unknowns, (..., p), with the stop errors optimal to first order."""
    columns = problem.columns
    names = [name for name in columns if name in state.transforms]
    tangents = np.zeros((len(names), *state.batch, 6))
    for k, name in enumerate(names):
        tangents[k, ..., : problem.column_width(name)] = step[..., columns[name]]
    updated = SE3.stack([state.transforms[name] for name in names]) @ SE3.exp(tangents) if names else SE3.identity((0,))
    transforms = {**state.transforms, **{name: updated[k] for k, name in enumerate(names)}}
    lenses = {
        name: retract_lens(lens, step[..., columns[name]]) for name, lens in state.cameras.items() if name in columns
    }
    robots = {
        robot: apply_step(model, state.kinematics(model), {name: step[..., columns[name]] for name in model.widths})
        for robot, model in problem.models.items()
        if problem.robot_model(robot)
    }
    return State(
        transforms, {**state.cameras, **lenses}, _stop_errors(problem, state, normal, step), {**state.robots, **robots}
    )


def retract_lens(camera: Camera, step: Array) -> Camera:
    """Return a lens after a step of its parameters, (..., 4 + k); focal lengths keep at least a fifth of their value.

    Parameters with a non-finite step stay unchanged: the rest of the state reveals such a step.
    """
    parameters = np.where(np.isfinite(step), camera.parameters + step, camera.parameters)
    parameters[..., :2] = np.maximum(parameters[..., :2], 0.2 * camera.focal)
    return camera.with_parameters(parameters)


def _private_cost(views: LinearisedViews, state: State, weight: Array) -> Array:
    """Change of the cost of the private stops' errors due to weights of views (..., n), (...)."""
    total = np.zeros(state.batch)
    for stop_views in views.private:
        squares = np.sum(state.stop_errors[..., stop_views.stop, :] ** 2, axis=-1)
        total += ((weight[..., stop_views.view] - 1) * squares).sum(-1)
    return total


def _linearise_group(problem: Problem, group: ViewGroup, state: State) -> tuple[Array, Array, LinearisedViews]:
    """Costs of a group's views, (..., n), log determinant of their private stops' information, and their expansion."""
    links = chain(group, state, problem.stops)
    lens = group.camera in problem.columns
    view = group.measurement.linearise(links.camera_from_target, state.cameras.get(group.camera), lens)
    motion = problem.jitter_motion(group)
    if motion is not None:
        view = ViewInformation(*without_motion(*view, motion))
    rows = view.gradient.shape[-1]
    derivative, columns = unknown_jacobian(problem, group, links, state, rows)
    stops = stop_error_jacobians(group, links, state, problem.stops, rows)
    number = problem.shared_stops
    shared = tuple(_select_views(stop, error, number[stop] >= 0, number) for stop, error in stops)
    private = tuple(_select_views(stop, error, number[stop] < 0, None) for stop, error in stops)
    marginal = _marginalise(view.gradient, view.information, private, state.stop_errors)
    views = LinearisedViews(
        marginal.gradient, marginal.information, marginal.eliminated_cost, derivative, columns, private, shared
    )
    return view.cost, marginal.log_det, views


def _select_views(stop: IntArray, error_jacobian: Array, mask: BoolArray, number: IntArray | None) -> StopViews:
    """Views of a mask, (n,), at their stops, which `number` renumbers if it is given."""
    view = np.flatnonzero(mask)
    if len(view) == len(stop):
        return StopViews(view, stop if number is None else number[stop], error_jacobian)
    chosen = stop[view]
    return StopViews(view, chosen if number is None else number[chosen], error_jacobian[..., view, :, :])


class _Marginal(NamedTuple):
    """Views with their private stops eliminated.

    Attributes:
        gradient: (..., n, q).
        information: (..., n, q, q).
        eliminated_cost: (..., n) decrease of the cost by the optimal step of these stops' errors alone.
        log_det: (...) log determinant of I + J'HJ.
    """

    gradient: Array
    information: Array
    eliminated_cost: Array
    log_det: Array


def _marginalise(gradient: Array, information: Array, stop_views: tuple[StopViews, ...], errors: Array) -> _Marginal:
    """Eliminate the private stops of views.

    (I + H S)^-1 H == H - H J (I + J'HJ)^-1 J'H, whose inner matrix is positive definite for any H. With the gradient
    f = u + J'g of the errors, the cost decreases by f' (I + J'HJ)^-1 f, and g' == g - H J (I + J'HJ)^-1 f.
    """
    if not any(len(part.view) for part in stop_views):
        return _Marginal(gradient, information, np.zeros(gradient.shape[:-1]), np.zeros(gradient.shape[:-2]))
    by_error = np.zeros((*gradient.shape, 6 * len(stop_views)))
    force = np.zeros((*gradient.shape[:-1], 6 * len(stop_views)))
    for i, part in enumerate(stop_views):
        by_error[..., part.view, :, 6 * i : 6 * i + 6] = part.by_error
        force[..., part.view, 6 * i : 6 * i + 6] = errors[..., part.stop, :]
    transposed, weighted = by_error.mT, information @ by_error
    force += (transposed @ gradient[..., None])[..., 0]
    inner = transposed @ weighted
    diagonal = np.einsum("...ii->...i", inner)  # a view
    diagonal += 1.0
    # If a lens's polynomial diverges, the identity is lost in rounding; a multiple of it keeps the matrix regular.
    # The largest entry of a positive definite matrix is on its diagonal.
    size = diagonal.max(-1)
    if not size.max() <= _ROUNDING_SCALE:
        diagonal += np.where(size > _ROUNDING_SCALE, _ROUNDING * size, 0.0)[..., None]
    solved, log_det = _solve_systems(inner, np.concatenate([weighted.mT, force[..., None]], -1))
    reductions = weighted @ solved
    symmetric = 0.5 * (reductions[..., :-1] + reductions[..., :-1].mT)
    return _Marginal(
        gradient - reductions[..., -1],
        information - symmetric,
        np.sum(force * solved[..., -1], -1),
        log_det,
    )


def _solve_systems(inner: Array, right: Array) -> tuple[Array, Array]:
    """Solutions of positive definite systems, (..., n, k, m), and their log determinants summed over n, (...)."""
    if inner.size // inner.shape[-1] ** 2 >= _MANY_SYSTEMS:
        try:
            root, log_det = inverse_factors(inner)
            return root.mT @ (root @ right), np.asarray(log_det.sum(-1))
        except np.linalg.LinAlgError:
            pass  # too ill-conditioned to factorise, for example if a lens's polynomial diverges
    return np.asarray(np.linalg.solve(inner, right)), np.asarray(np.linalg.slogdet(inner)[1].sum(-1))


def _stop_errors(problem: Problem, state: State, normal: NormalEquations, step: Array) -> Array:
    if not len(problem.stops):
        return state.stop_errors
    errors = state.stop_errors.copy()
    shared_step = np.zeros((0, 6))
    if normal.system is not None:
        shared_step = normal.system.step(step)
        errors[..., problem.shared_stops >= 0, :] += shared_step
    for part in normal.views:
        tangent = (part.by_unknowns @ step[..., None, part.columns, None])[..., 0]
        for at_stops in () if normal.system is None else part.shared:
            tangent[..., at_stops.view, :] += (at_stops.by_error @ shared_step[..., at_stops.stop, :, None])[..., 0]
        force = part.gradient + (part.information @ tangent[..., None])[..., 0]
        for at_stops in part.private:
            pull = at_stops.by_error.mT @ force[..., at_stops.view, :, None]
            errors[..., at_stops.stop, :] = -pull[..., 0]
    return errors


def prior_equations(problem: Problem, state: State) -> tuple[Array, Array, Array]:
    """Hessian (..., p, p), gradient (..., p) and cost (...) of the priors."""
    width = problem.width
    hessian, gradient = np.zeros((*state.batch, width, width)), np.zeros((*state.batch, width))
    cost = np.zeros(state.batch)
    for residual, jacobian, columns in prior_residuals(problem, state):
        transposed = jacobian.mT
        cost += np.sum(residual**2, -1)
        hessian[..., columns, columns] += transposed @ jacobian
        gradient[..., columns] += (transposed @ residual[..., None])[..., 0]
    return hessian, gradient, cost


def prior_residuals(problem: Problem, state: State) -> list[tuple[Array, Array, slice]]:
    """Residual of each prior, in sigmas, its derivative with respect to its columns, and these columns."""
    residuals = []
    for name, columns in problem.columns.items():
        if name in problem.unknowns:
            unknown = problem.unknowns[name]
            if unknown.status == "prior":
                width = columns.stop - columns.start
                residuals.append((*prior_residual(unknown, state.transforms[name], width), columns))
        elif name in problem.lenses:
            lens = problem.lenses[name]
            if lens.status == "prior" and lens.camera is not None and lens.sigma is not None:
                error = state.cameras[name].parameters - lens.camera.parameters
                residuals.append((error / lens.sigma, np.diag(1 / lens.sigma), columns))
            elif lens.status == "free":
                residuals += _lens_priors(state.cameras[name], columns)
    for name, held in problem.gauges.items():
        if name in problem.columns:
            residuals.append((np.zeros(6), np.diag(held / _GAUGE_SIGMA), problem.columns[name]))
    return residuals + _robot_residuals(problem, state)


def prior_residual(unknown: Unknown, value: SE3, width: int = 6) -> tuple[Array, Array]:
    """Residual (..., width) of a transform's prior, in sigmas, and its derivative with respect to its columns."""
    assert unknown.mean is not None
    assert unknown.sigma is not None
    error = (unknown.mean.inverse() @ value).log()
    jacobian = right_jacobian_inverse(error)[..., :width, :width] / unknown.sigma[:width, None]
    return error[..., :width] / unknown.sigma[:width], jacobian


def _lens_priors(camera: Camera, columns: slice) -> list[tuple[Array, Array, slice]]:
    """Priors of the distortion terms of an unstated lens, from the spread of real lenses."""
    sigmas = camera.term_sigmas
    terms = np.flatnonzero(np.isfinite(sigmas))
    if not len(terms):
        return []
    jacobian = np.zeros((len(terms), 4 + len(sigmas)))
    jacobian[np.arange(len(terms)), 4 + terms] = 1 / sigmas[terms]
    return [(camera.distortion[..., terms] / sigmas[terms], jacobian, columns)]


def _robot_residuals(problem: Problem, state: State) -> list[tuple[Array, Array, slice]]:
    residuals = []
    for model in filter(None, map(problem.robot_model, problem.models)):
        values = column_values(model, state.kinematics(model))
        for name in model.widths:
            sigma = model.sigmas[name]
            if sigma is not None:
                residuals.append((values[name] / sigma, np.diag(1 / sigma), problem.columns[name]))
    return residuals
