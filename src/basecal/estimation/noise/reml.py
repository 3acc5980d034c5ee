"""The restricted likelihood of sigmas, its slope, and what is known of everything else at given sigmas.

With y all that is unknown (columns flat or under priors, errors of stops of unit variance once scaled by their sigma),
M its information and g its gradient at the state, minus twice the logarithm is, but for a constant,

    sum n_f log sigma_f^2 + cost + log det M - g' M^-1 g

Its slope needs no differences: a sigma is stationary where the squares expected of what goes by it, given all data, are
as many as its freedoms. Nor does its curvature: the mean of what is observed and what is expected of it has no traces.
Source: Patterson & Thompson 1971, Harville 1977, Dempster, Laird & Rubin 1977 (the slope), Gilmour, Thompson & Cullis
1995 (the average information).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from basecal.estimation.noise.mixed_model import MixedModel, Moments
from basecal.estimation.noise.view_estimates import STATED
from basecal.geometry import Array, IntArray
from basecal.numerics.spectral import floored

_FLOOR = 1e-11  # of the scaled information where there is none: four digits above rounding
_ROUNDS_ONE = 1e12  # an entry of this size leaves the identity beside it four digits
_ROUNDING = 1e-13  # of such entries, which keeps it regular


@dataclass(frozen=True, eq=False)
class Posterior:
    """All that is unknown, given sigmas, to second order about the model's state.

    Attributes:
        model: The model.
        logs: (k,) logarithms of the sigmas.
        value: Minus twice the log of the restricted likelihood.
        of_columns: (m,) which of the logarithms scales a column; -1 for none.
        of_errors: (b, q) likewise of errors in blocks.
        mean_columns: (m,) most likely values, those of scaled columns in sigmas.
        mean_errors: (b, q) likewise.
        spread: (m, m) covariance of the columns.
        back: (b, q, m) how errors follow from columns, negative.
        own: (b, q, q) covariance of errors, the columns known.
    """

    model: MixedModel
    logs: Array
    value: float
    of_columns: IntArray
    of_errors: IntArray
    mean_columns: Array
    mean_errors: Array
    spread: Array
    back: Array
    own: Array

    @property
    def step(self) -> Array:
        """(p,) from the state to the most likely unknowns."""
        return self.mean_columns[: self.model.width]

    @property
    def covariance(self) -> Array:
        """(p, p) of the unknowns."""
        return self.spread[: self.model.width, : self.model.width]

    @property
    def stop_errors(self) -> Array:
        """(k, 6) most likely errors of all stops, those in common among them, in units of the problem."""
        columns = self.mean_columns * _scales(self.logs, self.of_columns)
        return self.model.stop_errors(self.mean_errors * _scales(self.logs, self.of_errors), columns)

    def slope(self) -> Array:
        """(k,) derivative of the value to the logarithms."""
        across = self.back @ self.spread
        of_errors = np.diagonal(self.own, axis1=-2, axis2=-1) + np.einsum("bqm,bqm->bq", across, self.back)
        slope = np.zeros(len(self.logs))
        for which, squares in (
            (self.of_errors, of_errors + self.mean_errors**2),
            (self.of_columns, np.diag(self.spread) + self.mean_columns**2),
        ):
            scaled = which >= 0
            slope += np.bincount(which[scaled], 2 * (1 - squares[scaled]), len(slope))
        covariance = self.own + across @ np.swapaxes(self.back, -1, -2)
        for i, key in enumerate(open_parts(self.model)):
            part = self.model.parts[key]
            squares = _squares(part, self, across, covariance)
            slope[i] += 2 * (part.count - np.exp(-2 * self.logs[i]) * squares)
        return slope

    def average_information(self) -> Array:
        """(k, k) the mean of the observed and the expected second derivative of the value to the logarithms.

        4 (S - V' M^-1 V), with a column of V for each sigma: the mean errors that it scales, or the gradient at the
        mean of the part that goes by it; S holds their sums of squares.
        """
        k = len(self.logs)
        columns, errors = np.zeros((k, len(self.mean_columns))), np.zeros((k, *self.mean_errors.shape))
        own = np.zeros(k)
        keys = open_parts(self.model)
        for i, key in enumerate(keys):
            own[i], columns[i], errors[i] = _at_mean(self.model.parts[key], self, float(np.exp(-2 * self.logs[i])))
        for i in range(len(keys), k):
            columns[i] = np.where(self.of_columns == i, self.mean_columns, 0.0)
            errors[i] = np.where(self.of_errors == i, self.mean_errors, 0.0)
            own[i] = np.sum(columns[i] ** 2) + np.sum(errors[i] ** 2)
        reduced = columns - np.einsum("bqm,kbq->km", self.back, errors)
        by_errors = np.einsum("kbq,bqr,lbr->kl", errors, self.own, errors, optimize=True)
        return np.asarray(4 * (np.diag(own) - reduced @ self.spread @ reduced.T - by_errors))


def open_parts(model: MixedModel) -> list[tuple[str, str]]:
    """Cameras and fields of `Noise` whose sigmas are open, in the order of the logarithms."""
    return sorted(key for key in model.parts if key[1] != STATED)


def sigma_count(model: MixedModel) -> int:
    """How many sigmas are open: of `open_parts`, and a pair a robot of each stop and of what stops have in common."""
    return len(open_parts(model)) + 2 * len(model.robots) * (2 if model.common.any() else 1)


def posterior(model: MixedModel, logs: Array) -> Posterior:
    """The restricted likelihood at logarithms of sigmas, (k,), and what is known of everything else there."""
    keys = open_parts(model)
    weights = dict.fromkeys(model.parts, 1.0) | {k: float(np.exp(-2 * v)) for k, v in zip(keys, logs, strict=False)}
    of_columns, of_errors = _which(model, len(keys))
    x, u = _scales(logs, of_columns), _scales(logs, of_errors)
    total = _weighed(model, weights)
    uu = total.errors_errors * u[:, :, None] * u[:, None, :] + np.eye(u.shape[1])
    ux = total.errors_fixed * u[:, :, None] * x
    bu, bx = total.errors * u, total.fixed * x + model.prior_gradient
    xx = total.fixed_fixed * x[:, None] * x + model.prior
    m = len(x)
    factor = np.linalg.cholesky(_regular(uu))
    root = np.asarray(np.linalg.inv(factor), dtype=np.float64)
    whitened = root @ np.concatenate([ux, bu[..., None]], -1)
    flat, cu = whitened[..., :m].reshape(u.size, m), whitened[..., m].reshape(u.size)
    gradient = bx - flat.T @ cu
    spread, log_det = _inverse(xx - flat.T @ flat, np.diag(xx))
    mean_x = -spread @ gradient
    value = sum(2 * model.parts[k].count * v for k, v in zip(keys, logs, strict=False))
    value += total.cost + model.prior_cost - float(cu @ cu) + float(gradient @ mean_x)
    value += 2 * float(np.log(np.diagonal(factor, axis1=-2, axis2=-1)).sum()) + log_det
    solved = np.swapaxes(root, -1, -2) @ whitened
    back, own = solved[..., :m], np.swapaxes(root, -1, -2) @ root
    mean_u = -(solved[..., m] + back @ mean_x)
    return Posterior(model, logs, value, of_columns, of_errors, mean_x, mean_u, spread, back, own)


def _regular(matrices: Array) -> Array:
    """I + S, with as much more of I as keeps it regular where S is so large that rounding loses it."""
    size = np.abs(matrices).max(axis=(-1, -2), initial=0.0)
    lost = np.where(size > _ROUNDS_ONE, _ROUNDING * size, 0.0)
    return matrices + lost[:, None, None] * np.eye(matrices.shape[-1])


def _which(model: MixedModel, first: int) -> tuple[IntArray, IntArray]:
    """Of each column and each error, which logarithm is that of its sigma; -1 where none is open."""
    shift = np.where(model.common, 2 * len(model.robots), 0)
    columns = np.where(model.column_robot >= 0, first + model.column_robot + shift, -1)
    return columns, np.where(model.error_robot >= 0, first + model.error_robot, -1)


def _scales(logs: Array, which: IntArray) -> Array:
    scales: Array = np.where(which >= 0, np.exp(np.append(logs, 0.0))[which], 1.0)
    return scales


def _weighed(model: MixedModel, weights: dict[tuple[str, str], float]) -> Moments:
    parts = [(weights[key], part) for key, part in model.parts.items()]
    fields = ("fixed", "errors", "fixed_fixed", "errors_fixed", "errors_errors")
    cost = sum(w * part.cost for w, part in parts)
    return Moments(0, cost, *(sum(w * getattr(part, field) for w, part in parts) for field in fields))


def _inverse(hessian: Array, before: Array) -> tuple[Array, float]:
    """Inverse and log determinant; directions without information are held by a floor, the same for all sigmas."""
    size = 1 / np.sqrt(np.maximum(before, 1e-300))
    scaled = 0.5 * (hessian + hessian.T) * size[:, None] * size
    try:
        factor = np.linalg.cholesky(scaled + _FLOOR * np.eye(len(scaled)))
        root = np.linalg.inv(factor)
        log_det = 2 * float(np.log(np.diag(factor)).sum())
    except np.linalg.LinAlgError:
        held = floored(scaled, _FLOOR)
        root, log_det = held.inverse_root.T, float(held.log_det)
    root = root * size
    return root.T @ root, log_det - 2 * float(np.log(size).sum())


def _squares(part: Moments, of: Posterior, across: Array, covariance: Array) -> float:
    """Expected sum of squares of a part's residuals at unit sigma, given all data."""
    x, u = _scales(of.logs, of.of_columns), _scales(of.logs, of.of_errors)
    at_x, at_u = of.mean_columns * x, of.mean_errors * u
    mean = part.cost + 2 * (part.fixed @ at_x + np.sum(part.errors * at_u)) + at_x @ part.fixed_fixed @ at_x
    mean += np.sum(at_u * (2 * part.errors_fixed @ at_x + (part.errors_errors @ at_u[..., None])[..., 0]))
    by_x = np.sum(part.fixed_fixed * x[:, None] * x * of.spread)
    both = np.sum(part.errors_fixed * u[:, :, None] * x * across)
    by_u = np.sum(part.errors_errors * u[:, :, None] * u[:, None, :] * covariance)
    return float(mean + by_x - 2 * both + by_u)


def _at_mean(part: Moments, of: Posterior, weight: float) -> tuple[float, Array, Array]:
    """A part's squares over variances at the mean, and half its gradient to columns, (m,), and errors, (b, q)."""
    x, u = _scales(of.logs, of.of_columns), _scales(of.logs, of.of_errors)
    at_x, at_u = of.mean_columns * x, of.mean_errors * u
    by_x = part.fixed_fixed @ at_x + np.einsum("bqm,bq->m", part.errors_fixed, at_u)
    by_u = part.errors_fixed @ at_x + (part.errors_errors @ at_u[..., None])[..., 0]
    squares = part.cost + at_x @ (2 * part.fixed + by_x) + np.sum(at_u * (2 * part.errors + by_u))
    return float(weight * squares), weight * x * (part.fixed + by_x), weight * u * (part.errors + by_u)
