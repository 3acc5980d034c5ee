"""Squared deviations of views, shared stops and points from the prediction of all other data.

g and H are the gradient and information of a view, with its private stops eliminated. P is the covariance of its
tangent due to the unknowns. d^2 is the squared deviation from all other views. It is g'(H - H P H)^+ g if the view is
part of the fit, and g'(H + H P H)^+ g if not. If the stated noise is true, d^2 is chi-square with rank(H) degrees of
freedom.
Source: Cook & Weisberg 1982 (studentised residuals); docs/mathematics.md (8.1), (8.2).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from basecal.estimation.least_squares.normal_equations import LinearisedViews, NormalEquations, linearise
from basecal.estimation.problem.problem import Problem, State
from basecal.estimation.problem.view_group import ViewGroup
from basecal.estimation.view.measurement import Measurement
from basecal.estimation.view.pixels import PixelMeasurement
from basecal.estimation.view.target_points import PointJacobians, SeenPoints, point_jacobians
from basecal.geometry import Array, BoolArray, IntArray
from basecal.numerics.spectral import VIEW_ROUNDING, inverse_beside_identity, scaled_spectrum, spectrum

_LEAST_GAIN_SHARE = 1e-9  # smallest relative reduction of a stop's variance by the views that is not rounding
_LARGEST_LEVERAGE = 1.0 - 1e-4  # of a direction of a view: above, the other data predict nothing
_FEWEST_OWN_POINTS = 12  # points of a view from which each is judged by the others of this view alone; assumed
_LEAST_VARIANCE_SHARE = 1e-3  # smallest share of a residual's variance that the fit leaves for a prediction


@dataclass(frozen=True, eq=False)
class MahalanobisSquared:
    """Squared deviations with their degrees of freedom; NaN and 0 if the other data predict nothing."""

    value: Array
    freedoms: IntArray


@dataclass(frozen=True, eq=False)
class LeaveOneOut:
    """Second-order expansion of a problem about a state, with the covariance of the views' predictions.

    Attributes:
        problem: The problem.
        state: The state.
        weights: (n,) 1 for views that are part of the fit, else 0; by group.
        normal: Normal equations about the state.
        spread: (n, q, q) covariance of each view's tangent due to unknowns and shared stops; by group.
    """

    problem: Problem
    state: State
    weights: tuple[Array, ...]
    normal: NormalEquations
    spread: tuple[Array, ...]

    def shared_stop_covariance(self) -> Array:
        """Posterior covariance of the errors of the s shared stops, (s, 6, 6), in squared sigmas."""
        system = self.normal.system
        if system is None:
            return np.zeros((0, 6, 6))
        numbers = np.arange(len(system.precision))
        by_unknowns = system.solution[:, :-1].reshape(len(numbers), 6, self.problem.width)
        covariance = spectrum(self.normal.hessian).inverse
        return system.covariance(numbers, numbers) + by_unknowns @ covariance @ by_unknowns.mT


def leave_one_out(problem: Problem, state: State, weights: Sequence[Array]) -> LeaveOneOut:
    """Expand a problem about a state that was fitted to the views of weight 1."""
    normal = linearise(problem, state, weights)
    covariance = spectrum(normal.hessian).inverse
    spread = tuple(_tangent_covariance(normal, covariance, k) for k in range(len(problem.groups)))
    return LeaveOneOut(problem, state, tuple(weights), normal, spread)


def view_misfits(problem: Problem, state: State) -> tuple[MahalanobisSquared, ...]:
    """Squared deviation of each view from a state assumed exact, (..., n), by group; infinite behind the camera.

    Args:
        problem: The problem.
        state: The state, or a batch of states.
    """
    normal = linearise(problem, state)
    return tuple(
        _group_misfits(group, expansion, state, problem)
        for group, expansion in zip(problem.groups, normal.views, strict=True)
    )


def _group_misfits(group: ViewGroup, views: LinearisedViews, state: State, problem: Problem) -> MahalanobisSquared:
    finite = np.asarray(np.isfinite(views.information).all((-1, -2)) & np.isfinite(views.gradient).all(-1))
    information = spectrum(np.where(finite[..., None, None], views.information, 0.0), VIEW_ROUNDING)
    gradient = np.where(finite[..., None], views.gradient, 0.0)
    is_lost = ~finite
    if isinstance(group.measurement, PixelMeasurement):
        is_lost |= state.camera_from_target(group, problem.stops).translation[..., 2] <= 0
    count = group.measurement.equations()
    return MahalanobisSquared(
        np.where(is_lost, np.inf, information.squared_mahalanobis(gradient)),
        np.where(is_lost, count, information.rank),
    )


def studentized_views(model: LeaveOneOut) -> tuple[MahalanobisSquared, ...]:
    """Squared deviation of each view from the prediction of the others, (n,), by group."""
    return tuple(_group_deviations(model, k) for k in range(len(model.problem.groups)))


def _group_deviations(model: LeaveOneOut, k: int) -> MahalanobisSquared:
    views, weight = model.normal.views[k], model.weights[k]
    information = spectrum(views.information, VIEW_ROUNDING)
    whitened = (information.inverse_root.mT @ views.gradient[..., None])[..., 0]
    leverage = information.root.mT @ model.spread[k] @ information.root
    sign = np.where(weight > 0, -1.0, 1.0)[:, None, None]
    decomposed = scaled_spectrum(np.eye(leverage.shape[-1]) + sign * leverage, 1 - _LARGEST_LEVERAGE)
    # Directions without information have whitened gradient zero and leverage zero.
    freedoms = np.maximum(information.rank - np.count_nonzero(~decomposed.is_informative, axis=-1), 0)
    return MahalanobisSquared(np.where(freedoms > 0, decomposed.squared_mahalanobis(whitened), np.nan), freedoms)


def studentized_stops(model: LeaveOneOut) -> MahalanobisSquared:
    """Squared deviation of the errors of shared stops from their stated noise, (k,); NaN for private stops."""
    count = len(model.problem.stops)
    value, freedoms = np.full(count, np.nan), np.zeros(count, dtype=np.int64)
    shared = np.flatnonzero(model.problem.shared_stops >= 0)
    reduction = scaled_spectrum(np.eye(6) - model.shared_stop_covariance(), _LEAST_GAIN_SHARE)
    value[shared], freedoms[shared] = reduction.squared_mahalanobis(model.state.stop_errors[shared]), reduction.rank
    return MahalanobisSquared(np.where(freedoms > 0, value, np.nan), freedoms)


def studentized_points(model: LeaveOneOut) -> tuple[MahalanobisSquared, ...]:
    """Squared deviation of each point from the prediction of all other points, (n, p), by group.

    In a view with many points, the prediction uses the other points of the view alone. With few points, it uses the
    state as well. Missing points, views without points and views of a single point, which `studentized_views` judges,
    have no degrees of freedom.
    """
    return tuple(_point_deviations(model, k) for k in range(len(model.problem.groups)))


def judged_by_view(measurement: Measurement) -> BoolArray:
    """Mask of the views, (n,), with enough points to judge each point by the rest of its view."""
    return np.asarray(measurement.point_counts() >= _FEWEST_OWN_POINTS)


def _point_deviations(model: LeaveOneOut, k: int) -> MahalanobisSquared:
    group = model.problem.groups[k]
    predicted = model.state.camera_from_target(group, model.problem.stops)
    has_columns = group.camera in model.problem.columns
    n, measurement = len(group), group.measurement
    if not isinstance(measurement, SeenPoints) or len(measurement.points_in_target) < 2:
        return MahalanobisSquared(np.full((n, 1), np.nan), np.zeros((n, 1), dtype=np.int64))
    rows = point_jacobians(measurement, predicted, model.state.cameras.get(group.camera), has_columns)
    own = judged_by_view(group.measurement)
    if own.all():
        return _own_view_distances(rows)
    squares = _studentize(rows.residual, rows.jacobian, _posterior_covariance(model, k, rows), rows.seen)
    if not own.any():
        return squares
    mask, by_view = own[:, None], _own_view_distances(rows)
    return MahalanobisSquared(
        np.where(mask, by_view.value, squares.value), np.where(mask, by_view.freedoms, squares.freedoms)
    )


def _own_view_distances(rows: PointJacobians) -> MahalanobisSquared:
    """Squared deviation of each point from the pose fitted to its view alone, to first order."""
    jacobian = rows.jacobian[..., :6]
    n, p, d, _ = jacobian.shape
    flat = jacobian.reshape(n, p * d, 6)
    pose_spread = spectrum(flat.mT @ flat, VIEW_ROUNDING).inverse
    gradient = flat.mT @ rows.residual.reshape(n, p * d, 1)
    residual = rows.residual - (flat @ (pose_spread @ gradient)).reshape(n, p, d)
    return _studentize(residual, jacobian, pose_spread, rows.seen)


def _studentize(residual: Array, jacobian: Array, covariance: Array, visible: BoolArray) -> MahalanobisSquared:
    """Squared Mahalanobis norms of residuals (n, p, d) about a fitted tangent of covariance (n, q, q)."""
    n, p, d, q = jacobian.shape
    products = (jacobian.reshape(n, p * d, q) @ covariance).reshape(jacobian.shape)
    residual_covariance = np.eye(d) - np.einsum("npiq,npjq->npij", products, jacobian)
    if d == 2:
        value, certain = _pair_distances(residual, residual_covariance)
        if certain[visible].all():
            return MahalanobisSquared(np.where(visible, value, np.nan), 2 * visible.astype(np.int64))
    decomposed = scaled_spectrum(residual_covariance, _LEAST_VARIANCE_SHARE)
    freedoms = np.where(visible, decomposed.rank, 0)
    return MahalanobisSquared(np.where(freedoms > 0, decomposed.squared_mahalanobis(residual), np.nan), freedoms)


def _pair_distances(residual: Array, matrix: Array) -> tuple[Array, BoolArray]:
    """Squared norms r' M^-1 r of 2-vectors r, and whether M is regular; written out, since small solves are slow."""
    a, b, c = matrix[..., 0, 0], matrix[..., 0, 1], matrix[..., 1, 1]
    x, y = residual[..., 0], residual[..., 1]
    determinant = a * c - b * b
    certain = np.asarray((determinant > _LEAST_VARIANCE_SHARE) & (a > 0))
    return (c * x * x - 2 * b * x * y + a * y * y) / np.where(certain, determinant, 1.0), certain


def _posterior_covariance(model: LeaveOneOut, k: int, rows: PointJacobians) -> Array:
    """Posterior covariance of each view's tangent, including its private stops' errors, (n, q, q)."""
    spread = model.spread[k] * (model.weights[k] > 0)[:, None, None]
    n, p, d, q = rows.jacobian.shape
    flat = rows.jacobian.reshape(n, p * d, q)
    information = flat.mT @ flat
    by_error = model.normal.views[k].private_error_jacobian
    inner = inverse_beside_identity(by_error.mT @ information @ by_error)
    stop_covariance = by_error @ inner @ by_error.mT
    remainder = np.eye(q) - stop_covariance @ information
    posterior: Array = remainder @ spread @ remainder.mT + stop_covariance
    return posterior


def _tangent_covariance(normal: NormalEquations, covariance: Array, k: int) -> Array:
    views = normal.views[k]
    derivative = views.by_unknowns
    if normal.system is None:
        return derivative @ covariance[np.ix_(views.columns, views.columns)] @ derivative.mT
    n, q, _ = derivative.shape
    full = np.zeros((n, q, len(covariance)))
    full[:, :, views.columns] = derivative
    by_unknowns = normal.system.solution[:, :-1].reshape(len(normal.system.precision), 6, len(covariance))
    for stop_views in views.shared:
        full[stop_views.view] -= stop_views.by_error @ by_unknowns[stop_views.stop]
    return full @ covariance @ full.mT + _stop_covariance(normal, k)


def _stop_covariance(normal: NormalEquations, k: int) -> Array:
    """Covariance of the views' tangents due to shared stops, given the unknowns, (n, q, q)."""
    views, system = normal.views[k], normal.system
    assert system is not None
    n, q = views.gradient.shape
    total = np.zeros((n, q, q))
    for a in views.shared:
        for b in views.shared:
            common, i, j = np.intersect1d(a.view, b.view, assume_unique=True, return_indices=True)
            block = system.covariance(a.stop[i], b.stop[j])
            total[common] += a.by_error[i] @ block @ b.by_error[j].mT
    return total
