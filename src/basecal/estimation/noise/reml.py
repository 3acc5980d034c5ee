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
from typing import Any

import numpy as np

from basecal.estimation.noise.mixed_model import MixedModel, Moments
from basecal.estimation.noise.view_estimates import STATED
from basecal.geometry import Array, IntArray
from basecal.geometry.rotation import with_identity
from basecal.numerics.inverse_factors import inverse_factors
from basecal.numerics.spectral import floored

_FLOOR = 1e-11  # of the scaled information where there is none: four digits above rounding
_ROUNDS_ONE = 1e12  # an entry of this size leaves the identity beside it four digits
_ROUNDING = 1e-13  # of such entries, which keeps it regular
_AT_ONCE = 2**17  # numbers of an array over blocks: a megabyte stays near the processor, which memory keeps waiting


@dataclass(frozen=True, eq=False)
class Columns:
    """The columns alone, given sigmas: what a node of the sigmas asks for.

    Attributes:
        model: The model.
        logs: (k,) logarithms of the sigmas.
        value: Minus twice the log of the restricted likelihood.
        mean: (m,) most likely values, those of scaled columns in sigmas.
        spread: (m, m) their covariance.
    """

    model: MixedModel
    logs: Array
    value: float
    mean: Array
    spread: Array

    @property
    def step(self) -> Array:
        """(p,) from the state to the most likely unknowns."""
        return self.mean[: self.model.width]

    @property
    def covariance(self) -> Array:
        """(p, p) of the unknowns."""
        return self.spread[: self.model.width, : self.model.width]

    def in_units(self, columns: IntArray) -> tuple[Array, Array]:
        """Mean, (c,), and covariance, (c, c), of some columns, those of errors in metres and radians, not sigmas."""
        scales = _scales(self.logs, _which(self.model, len(open_parts(self.model)))[0])[columns]
        return self.mean[columns] * scales, self.spread[np.ix_(columns, columns)] * scales[:, None] * scales


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
        slope = np.zeros(len(self.logs))
        keys = open_parts(self.model)
        squares = np.array([_squares_of_mean(self.model.parts[key], self) for key in keys])
        of_errors = self.mean_errors**2
        for here in _chunks(*self.back.shape):
            back = self.back[here]
            across = (back.reshape(-1, back.shape[-1]) @ self.spread).reshape(back.shape)
            covariance = self.own[here] + across @ back.mT
            of_errors[here] += np.diagonal(covariance, axis1=-2, axis2=-1)
            for i, key in enumerate(keys):
                squares[i] += _squares_of_spread(self.model.parts[key], self, here, across, covariance)
        for which, expected in (
            (self.of_errors, of_errors),
            (self.of_columns, np.diag(self.spread) + self.mean_columns**2),
        ):
            scaled = which >= 0
            slope += np.bincount(which[scaled], 2 * (1 - expected[scaled]), len(slope))
        for i, key in enumerate(keys):
            slope[i] += 2 * (self.model.parts[key].count - np.exp(-2 * self.logs[i]) * squares[i])
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
        reduced = columns - errors.reshape(k, -1) @ self.back.reshape(-1, self.back.shape[-1])
        by_errors = np.einsum("kbq,bqr,lbr->kl", errors, self.own, errors, optimize=True)
        return np.asarray(4 * (np.diag(own) - reduced @ self.spread @ reduced.T - by_errors))


def open_parts(model: MixedModel) -> list[tuple[str, str]]:
    """Cameras and fields of `Noise` whose sigmas are open, in the order of the logarithms."""
    return sorted(key for key in model.parts if key[1] != STATED)


def sigma_count(model: MixedModel) -> int:
    """How many sigmas are open: of `open_parts`, of robots' stops in pairs, of jitter, of what stops have in common."""
    pairs = 2 * len(model.robots)
    return len(open_parts(model)) + pairs + len(model.shaken) + (pairs if model.common.any() else 0)


def sigmas_of(model: MixedModel, robot: str) -> slice:
    """Where the two sigmas of a robot's single stops stand among the logarithms."""
    at = len(open_parts(model)) + 2 * model.robots.index(robot)
    return slice(at, at + 2)


def posterior(model: MixedModel, logs: Array) -> Posterior:
    """The restricted likelihood at logarithms of sigmas, (k,), and what is known of everything else there."""
    _, of_errors = _which(model, len(open_parts(model)))
    b, q, m = *of_errors.shape, len(model.prior)
    blocks = _Blocks(np.empty((b, q)), np.empty((b, q, m)), np.empty((b, q, q)))
    known = columns_given(model, logs, blocks)
    of_columns, _ = _which(model, len(open_parts(model)))
    errors = -(blocks.alone + blocks.back @ known.mean)
    of_all = (of_columns, of_errors, known.mean, errors, known.spread)
    return Posterior(model, logs, known.value, *of_all, blocks.back, blocks.own)


@dataclass(frozen=True, eq=False)
class _Blocks:
    """Of errors in blocks: what they are where the columns are zero, negative, and `back` and `own` of `Posterior`."""

    alone: Array
    back: Array
    own: Array


def columns_given(model: MixedModel, logs: Array, blocks: _Blocks | None = None) -> Columns:
    """The restricted likelihood at logarithms of sigmas, (k,), and what is known of the columns there.

    Args:
        model: The model.
        logs: The logarithms.
        blocks: Filled with what is known of the errors in blocks, where that is asked for.
    """
    keys = open_parts(model)
    weights = dict.fromkeys(model.parts, 1.0) | {k: float(np.exp(-2 * v)) for k, v in zip(keys, logs, strict=False)}
    of_columns, of_errors = _which(model, len(keys))
    x, u = _scales(logs, of_columns), _scales(logs, of_errors)
    cost, fixed, fixed_fixed = _weighed(model, weights, ("cost", "fixed", "fixed_fixed"), ...)
    value = sum(2 * model.parts[k].count * v for k, v in zip(keys, logs, strict=False)) + cost + model.prior_cost
    m = len(x)
    explained, by_errors = np.zeros((m, m)), np.zeros(m)
    for here in _chunks(len(u), u.shape[1], m):
        scale = u[here]
        bu, ux, uu = _weighed(model, weights, ("errors", "errors_fixed", "errors_errors"), here)
        uu *= scale[:, :, None]
        uu *= scale[:, None, :]
        root, log_dets = inverse_factors(_regular(with_identity(uu, np.ones(len(uu)))))
        scaled = root * scale[:, None, :]
        whitened, cu = scaled @ ux, (scaled @ bu[..., None])[..., 0]
        flat = whitened.reshape(-1, m)
        by_errors += flat.T @ cu.reshape(-1)
        explained += flat.T @ flat
        value += float(log_dets.sum()) - float(np.sum(cu**2))
        if blocks is not None:
            back = root.mT
            np.multiply(back @ whitened, x, out=blocks.back[here])
            blocks.alone[here] = (back @ cu[..., None])[..., 0]
            blocks.own[here] = back @ root
    gradient = (fixed - by_errors) * x + model.prior_gradient
    told = (fixed_fixed - explained) * x[:, None] * x + model.prior
    spread, log_det = _inverse(told, np.diag(fixed_fixed) * x**2 + np.diag(model.prior))
    mean = -spread @ gradient
    return Columns(model, logs, value + float(gradient @ mean) + log_det, mean, spread)


def _chunks(blocks: int, rows: int, columns: int) -> list[slice]:
    """So many blocks at a time."""
    size = max(1, _AT_ONCE // max(1, rows * columns))
    return [slice(first, first + size) for first in range(0, blocks, size)]


def _regular(matrices: Array) -> Array:
    """I + S, with as much more of I as keeps it regular where S is so large that rounding loses it."""
    size = np.einsum("...ii->...i", matrices).max(axis=-1, initial=0.0)  # no entry is larger than the largest of these
    if not size.max(initial=0.0) > _ROUNDS_ONE:
        return matrices
    lost = np.where(size > _ROUNDS_ONE, _ROUNDING * size, 0.0)
    return matrices + lost[:, None, None] * np.eye(matrices.shape[-1])


def _which(model: MixedModel, first: int) -> tuple[IntArray, IntArray]:
    """Of each column and each error, which logarithm is that of its sigma; -1 where none is open."""
    shift = np.where(model.common, 2 * len(model.robots) + len(model.shaken), 0)
    columns = np.where(model.column_robot >= 0, first + model.column_robot + shift, -1)
    return columns, np.where(model.error_robot >= 0, first + model.error_robot, -1)


def _scales(logs: Array, which: IntArray) -> Array:
    scales: Array = np.where(which >= 0, np.exp(np.append(logs, 0.0))[which], 1.0)
    return scales


def _weighed(model: MixedModel, weights: dict[tuple[str, str], float], fields: tuple[str, ...], here: Any) -> list[Any]:
    """Fields of the moments of all parts, or of some blocks of them, each part by its weight."""
    (first, part), *others = model.parts.items()
    found = [weights[first] * np.asarray(getattr(part, field))[here] for field in fields]
    for key, other in others:
        for k, field in enumerate(fields):
            found[k] = found[k] + weights[key] * np.asarray(getattr(other, field))[here]
    return found


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


def _squares_of_mean(part: Moments, of: Posterior) -> float:
    """Sum of squares of a part's residuals at unit sigma at the mean, with what the columns' spread adds."""
    x = _scales(of.logs, of.of_columns)
    squares, _, _ = _at_mean(part, of, 1.0)
    return squares + float(np.sum(part.fixed_fixed * x[:, None] * x * of.spread))


def _squares_of_spread(part: Moments, of: Posterior, here: slice, across: Array, covariance: Array) -> float:
    """What is expected to come to that by the errors of some blocks, given all data."""
    x, u = _scales(of.logs, of.of_columns), _scales(of.logs, of.of_errors[here])
    by_x = (across.reshape(-1, len(x)) * x).reshape(across.shape)
    both = np.vdot(u, np.vecdot(part.errors_fixed[here], by_x))
    by_u = np.vdot(u, np.vecdot(part.errors_errors[here], u[:, None, :] * covariance))
    return float(by_u - 2 * both)


def _at_mean(part: Moments, of: Posterior, weight: float) -> tuple[float, Array, Array]:
    """A part's squares over variances at the mean, and half its gradient to columns, (m,), and errors, (b, q)."""
    x, u = _scales(of.logs, of.of_columns), _scales(of.logs, of.of_errors)
    at_x, at_u = of.mean_columns * x, of.mean_errors * u
    by_x = part.fixed_fixed @ at_x + at_u.ravel() @ part.errors_fixed.reshape(-1, len(x))
    by_u = part.errors_fixed @ at_x + (part.errors_errors @ at_u[..., None])[..., 0]
    squares = part.cost + at_x @ (2 * part.fixed + by_x) + np.sum(at_u * (2 * part.errors + by_u))
    return float(weight * squares), weight * x * (part.fixed + by_x), weight * u * (part.errors + by_u)
