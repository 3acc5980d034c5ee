"""Restricted likelihood (REML) of sigmas, its gradient, and the posterior of all unknowns at given sigmas.

The unknowns are the columns, with flat or normal priors, and the errors of stops, of unit variance in units of their
sigma. M is their information matrix and g their gradient at the state. Up to a constant, minus twice the logarithm is

    sum n_f log sigma_f^2 + cost + log det M - g' M^-1 g

The gradient needs no finite differences. A sigma is stationary if the expected sum of the squares that it scales, given
all data, equals its degrees of freedom. The average information needs neither finite differences nor traces: the traces
cancel in the mean of the observed and the expected information.
Source: Patterson & Thompson 1971, Harville 1977, Dempster, Laird & Rubin 1977 (the gradient), Gilmour, Thompson &
Cullis 1995 (the average information).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from scipy.linalg.lapack import dtrtrs

from basecal.estimation.noise.layout import chunks
from basecal.estimation.noise.mixed_model import MixedModel, Moments
from basecal.geometry import Array, IntArray
from basecal.geometry.rotation import with_identity
from basecal.numerics.batch import take
from basecal.numerics.inverse_factors import inverse_factors
from basecal.numerics.spectral import floored_spectrum

_FLOOR = 1e-11  # smallest eigenvalue of the scaled information: four digits above rounding
_ROUNDING_SCALE = 1e12  # an entry of this size leaves four digits of an identity that is added to it
_ROUNDING = 1e-13  # share of such entries that is added to keep the sum regular
_CHUNK_NUMBERS = 2**19  # numbers of an array over nodes and blocks: 4 MB, the fastest size from 2^15 to 2^21


@dataclass(frozen=True, eq=False)
class Columns:
    """Posterior of some columns, at one node of the sigmas or at several.

    Attributes:
        value: (...) minus twice the log of the restricted likelihood.
        mean: (..., c) means, those of scaled columns in sigmas.
        spread: (..., c, c) covariances.
    """

    value: Array
    mean: Array
    spread: Array


@dataclass(frozen=True, eq=False)
class Posterior:
    """Posterior of all unknowns, given sigmas, to second order about the model's state.

    Attributes:
        model: The model.
        logs: (k,) logarithms of the sigmas.
        value: Minus twice the log of the restricted likelihood.
        mean_columns: (m,) means of the columns, those of scaled columns in sigmas.
        mean_errors: (b, q) means of the errors in blocks, in sigmas.
        spread: (m, m) covariance of the columns.
        blocks: Quantities of the elimination of the errors in blocks.
    """

    model: MixedModel
    logs: Array
    value: float
    mean_columns: Array
    mean_errors: Array
    spread: Array
    blocks: _Blocks

    @property
    def step(self) -> Array:
        """Step from the state to the posterior mean of the unknowns, (p,)."""
        return self.mean_columns[: self.model.width]

    @property
    def covariance(self) -> Array:
        """Covariance of the unknowns, (p, p)."""
        return self.spread[: self.model.width, : self.model.width]

    @property
    def stop_errors(self) -> Array:
        """Posterior mean of the errors of all stops, shared errors included, (k, 6) in units of the problem."""
        columns = self.mean_columns * scales(self.logs, self.model.of_columns)
        return self.model.stop_errors(self.mean_errors * scales(self.logs, self.model.of_errors), columns)

    def slope(self) -> Array:
        """Derivative of `value` with respect to the logarithms, (k,)."""
        k, keys, model = len(self.logs), tuple(self.model.sigmas.views), self.model
        has_single_part = len(self.model.parts) == 1 and not self.blocks.lost.any()
        expected, squares = self._expected_by_sums(keys) if has_single_part else self._expected_by_blocks(keys)
        open_errors = model.of_errors[model.of_errors >= 0]
        slope = 2 * (np.bincount(open_errors, minlength=k) - expected)
        scaled = model.of_columns >= 0
        squares_of_columns = np.diag(self.spread) + self.mean_columns**2
        slope += np.bincount(model.of_columns[scaled], 2 * (1 - squares_of_columns[scaled]), k)
        for i, key in enumerate(keys):
            total = self._squares_of_mean(key) + squares[i]
            slope[i] += 2 * (self.model.parts[key].count - np.exp(-2 * self.logs[i]) * total)
        return slope

    @cached_property
    def _mean_moments(self) -> dict[tuple[str, str], tuple[float, Array, Array]]:
        """Result of `_part_moments` for each part with an unstated sigma."""
        return {key: _part_moments(self.model.parts[key], self) for key in self.model.sigmas.views}

    def _squares_of_mean(self, key: tuple[str, str]) -> float:
        """Sum of a part's squared residuals at the mean, at unit sigma, plus the share of the columns' spread."""
        x = scales(self.logs, self.model.of_columns)
        by_spread = np.sum(self.model.parts[key].fixed_fixed * x[:, None] * x * self.spread)
        return self._mean_moments[key][0] + float(by_spread)

    def _expected_by_sums(self, keys: Sequence[tuple[str, str]]) -> tuple[Array, Array]:
        """Result of `_expected_by_blocks` if there is only one part, by sums over all blocks at half the cost.

        B is the part's information of errors, F that of errors and columns, w its weight. I + w u B u is the inverse of
        `own`, and w u F x its product with `coefficients`. The squares then follow from `coefficients` and `own` alone.
        """
        k, own = len(self.logs), np.einsum("bqq->bq", self.blocks.own)
        sums = np.zeros((k + 1, *self.spread.shape))
        for chunk in self.model.layout.chunks(len(self.spread)):
            coefficients, sigma_index = self._error_coefficients(chunk), self.model.of_errors[chunk]
            for sigma in np.unique(sigma_index):
                rows = coefficients[sigma_index == sigma]
                sums[sigma] += rows.T @ rows
        x = scales(self.logs, self.model.of_columns)
        sums *= x[:, None] * x
        scaled = self.model.of_errors >= 0
        errors_squared = np.bincount(self.model.of_errors[scaled], (own + self.mean_errors**2)[scaled], k)
        squares = own.size - own.sum() - np.vdot(self.spread, self.blocks.explained + sums.sum(0))
        return errors_squared + np.tensordot(sums[:k], self.spread, 2), squares * np.exp(2 * self.logs[: len(keys)])

    def _expected_by_blocks(self, keys: Sequence[tuple[str, str]]) -> tuple[Array, Array]:
        """Expected squares of errors by their sigma, (k,), and contribution of the errors' spread to each part."""
        squares, errors_squared = np.zeros(len(keys)), self.mean_errors**2
        x = scales(self.logs, self.model.of_columns)
        for chunk in self.model.layout.chunks(len(self.spread)):
            coefficients = self._error_coefficients(chunk) * x
            cross_covariance = (coefficients.reshape(-1, coefficients.shape[-1]) @ self.spread).reshape(
                coefficients.shape
            )
            covariance = self.blocks.own[*chunk, chunk[1]] + cross_covariance @ coefficients.mT
            errors_squared[chunk] += np.diagonal(covariance, axis1=-2, axis2=-1)
            for i, key in enumerate(keys):
                squares[i] += _squares_of_spread(self.model.parts[key], self, chunk, cross_covariance, covariance)
        scaled = self.model.of_errors >= 0
        return np.bincount(self.model.of_errors[scaled], errors_squared[scaled], len(self.logs)).astype(
            np.float64
        ), squares

    def _error_coefficients(self, here: tuple[slice, slice]) -> Array:
        """Negative derivative of the errors of some blocks with respect to the unscaled columns, (b, q, m)."""
        scaled = self.blocks.own[*here, here[1]] * scales(self.logs, self.model.of_errors[here])[:, None, :]
        return np.asarray(scaled @ self.blocks.by_columns[here])

    def average_information(self) -> Array:
        """Average information, (k, k): mean of the observed and expected Hessian of `value` in the logarithms.

        The mean is 4 (S - V' M^-1 V). V has a column for each sigma: the mean errors that it scales, or the gradient at
        the mean of the part that it scales. S holds their sums of squares.
        """
        k = len(self.logs)
        columns, errors = np.zeros((k, len(self.mean_columns))), np.zeros((k, *self.mean_errors.shape))
        own = np.zeros(k)
        keys = tuple(self.model.sigmas.views)
        for i, key in enumerate(keys):
            weight = np.exp(-2 * self.logs[i])
            own[i], columns[i], errors[i] = (weight * part for part in self._mean_moments[key])
        for i in range(len(keys), k):
            columns[i] = np.where(self.model.of_columns == i, self.mean_columns, 0.0)
            errors[i] = np.where(self.model.of_errors == i, self.mean_errors, 0.0)
            own[i] = np.sum(columns[i] ** 2) + np.sum(errors[i] ** 2)
        products = (self.blocks.own @ errors.transpose(1, 2, 0)).transpose(2, 0, 1).reshape(k, -1)
        scaled = products * scales(self.logs, self.model.of_errors).ravel()
        by_columns = scaled @ self.blocks.by_columns.reshape(-1, columns.shape[-1])
        reduced = columns - by_columns * scales(self.logs, self.model.of_columns)
        by_errors = errors.reshape(k, -1) @ products.T
        return np.asarray(4 * (np.diag(own) - reduced @ self.spread @ reduced.T - by_errors))


def posterior(model: MixedModel, logs: Array) -> Posterior:
    """Return the posterior of all unknowns at logarithms of sigmas, (k,), with the restricted likelihood."""
    b, q, m = *model.of_errors.shape, len(model.prior)
    own = np.broadcast_to(np.eye(q), (b, q, q)).copy()
    blocks = _Blocks(np.zeros((b, q)), own, np.zeros((b, q, m)), np.zeros(b), np.empty((m, m)))
    equations = Equations(*(part[None] for part in _eliminate_errors(model, logs, blocks)))
    columns = take(_solve(equations, np.arange(m)), 0)
    # The errors are those at zero columns plus the change due to the columns' mean.
    u, scaled_columns = scales(logs, model.of_errors), columns.mean * scales(logs, model.of_columns)
    errors = -(blocks.alone + (blocks.own @ (u * (blocks.by_columns @ scaled_columns))[..., None])[..., 0])
    return Posterior(model, logs, float(columns.value), columns.mean, errors, columns.spread, blocks)


def _weights(model: MixedModel, logs: Array) -> dict[tuple[str, str], Array]:
    """Weight of each part, (...): the inverse square of its sigma, or 1 if the sigma is stated."""
    stated = np.ones(logs.shape[:-1])
    return dict.fromkeys(model.parts, stated) | {k: np.exp(-2 * logs[..., at]) for k, at in model.sigmas.views.items()}


@dataclass(frozen=True, eq=False)
class _Blocks:
    """Elimination of the errors in blocks.

    Attributes:
        alone: (b, q) negative mean of the errors if the columns are zero.
        own: (b, q, q) covariance of the errors given the columns.
        by_columns: (b, q, m) information of errors and columns, the weighted sum of all parts.
        lost: (b,) multiple of the identity added to the errors' information if the prior's identity is lost in
            rounding; else 0.
        explained: (m, m) reduction of the information of the columns by the elimination.
    """

    alone: Array
    own: Array
    by_columns: Array
    lost: Array
    explained: Array


def node_equations(model: MixedModel, nodes: Array) -> list[Equations]:
    """Equations of the columns at nodes of the sigmas, (n, k) logarithms.

    Nodes are processed in chunks, since the overhead of NumPy's calls is half the time if they are processed singly.
    """
    parts = chunks(len(nodes), model.of_errors.size, len(model.prior), _CHUNK_NUMBERS)
    return [_eliminate_errors(model, nodes[chunk]) for chunk in parts]


def solve_columns(equations: Iterable[Equations], columns: IntArray) -> Columns:
    """Solve for some columns, (c,), at all nodes of the sigmas."""
    parts = [_solve(each, columns) for each in equations]
    return Columns(*(np.concatenate([getattr(part, name) for part in parts]) for name in ("value", "mean", "spread")))


class Equations(NamedTuple):
    """Normal equations of the columns, with the errors in blocks eliminated.

    Attributes:
        value: (...) minus twice the log of the restricted likelihood, without the contribution of the columns.
        hessian: (..., m, m).
        information: (..., m) diagonal of the Hessian before the elimination.
        gradient: (..., m).
    """

    value: Array
    hessian: Array
    information: Array
    gradient: Array


def _eliminate_errors(model: MixedModel, logs: Array, blocks: _Blocks | None = None) -> Equations:
    """Equations of the columns at logarithms of sigmas, (..., k); with a single node, (k,), `blocks` may be filled."""
    weights = _weights(model, logs)
    x, u = scales(logs, model.of_columns), scales(logs, model.of_errors)
    cost, fixed, fixed_fixed = _weigh(model, weights, ("cost", "fixed", "fixed_fixed"), ...)
    log_dets_of_sigmas = sum(2 * model.parts[key].count * logs[..., at] for key, at in model.sigmas.views.items())
    value, m = log_dets_of_sigmas + cost + model.prior_cost, x.shape[-1]
    explained, by_errors = np.zeros(fixed_fixed.shape), np.zeros(x.shape)
    for chunk in model.layout.chunks(m):
        square = (*chunk, chunk[1])
        scale = u[..., *chunk]
        bu, ux = _weigh(model, weights, ("errors", "errors_fixed"), chunk)
        (uu,) = _weigh(model, weights, ("errors_errors",), square)
        uu *= scale[..., :, None]
        uu *= scale[..., None, :]
        uu = with_identity(uu, np.ones(uu.shape[:-2]))
        rounding_loss = _rounding_loss(uu)
        root, log_dets = inverse_factors(uu if rounding_loss is None else with_identity(uu, rounding_loss))
        scaled = root * scale[..., None, :]
        whitened, cu = scaled @ ux, (scaled @ bu[..., None])[..., 0]
        flat, flat_cu = whitened.reshape(*logs.shape[:-1], -1, m), cu.reshape(*logs.shape[:-1], -1)
        by_errors += (flat.mT @ flat_cu[..., None])[..., 0]
        explained += flat.mT @ flat
        value = value + log_dets.sum(-1) - np.sum(flat_cu**2, -1)
        if blocks is not None:
            blocks.alone[chunk] = (root.mT @ cu[..., None])[..., 0]
            np.matmul(root.mT, root, out=blocks.own[square])
            blocks.by_columns[chunk] = ux
            blocks.lost[chunk[0]] = 0.0 if rounding_loss is None else rounding_loss
    by_scales = x[..., :, None] * x[..., None, :]
    explained *= by_scales
    if blocks is not None:
        blocks.explained[...] = explained
    information = np.diagonal(fixed_fixed, axis1=-2, axis2=-1) * x**2 + np.diag(model.prior)
    hessian = fixed_fixed * by_scales - explained + model.prior
    return Equations(value, hessian, information, (fixed - by_errors) * x + model.prior_gradient)


def _solve(equations: Equations, columns: IntArray) -> Columns:
    """Posterior of some columns, (c,), at nodes, (n,); a floor regularises directions without information."""
    # Columns without information keep their unit.
    size = 1 / np.sqrt(np.where(equations.information > 0, equations.information, 1.0))
    scaled = 0.5 * (equations.hessian + equations.hessian.mT) * size[:, :, None] * size[:, None, :]
    right = np.zeros((*size.shape, len(columns) + 1))
    right[:, columns, np.arange(len(columns))] = size[:, columns]
    right[..., -1] = equations.gradient * size
    try:
        factor = np.linalg.cholesky(scaled + _FLOOR * np.eye(size.shape[-1]))
        whitened = np.array([dtrtrs(lower.T, rows, trans=1)[0] for lower, rows in zip(factor, right, strict=True)])
        log_det = 2 * np.log(np.diagonal(factor, axis1=-2, axis2=-1)).sum(-1)
    except np.linalg.LinAlgError:
        decomposed = floored_spectrum(scaled, _FLOOR)
        whitened, log_det = decomposed.inverse_root.mT @ right, decomposed.log_det
    root, force = whitened[..., :-1], whitened[..., -1:]
    value = equations.value - np.sum(force**2, (-2, -1)) + log_det - 2 * np.log(size).sum(-1)
    return Columns(value, -(root.mT @ force)[..., 0], root.mT @ root)


def _rounding_loss(matrices: Array) -> Array | None:
    """Multiple of I that keeps I + S regular, (...), if I is lost in rounding; None if no matrix needs it."""
    size = np.einsum("...ii->...i", matrices).max(axis=-1)  # the largest entry of a positive definite matrix
    large = size > _ROUNDING_SCALE
    return np.where(large, _ROUNDING * size, 0.0) if large.any() else None


def scales(logs: Array, indices: IntArray) -> Array:
    """Sigmas, (..., *), of logarithms, (..., k), at indices, (*); 1 at index -1."""
    sigmas = np.exp(np.concatenate([logs, np.zeros((*logs.shape[:-1], 1))], axis=-1))
    return np.asarray(sigmas[..., indices])  # -1 indexes the last


def _weigh(model: MixedModel, weights: dict[tuple[str, str], Array], fields: tuple[str, ...], here: Any) -> list[Any]:
    """Weighted sums over all parts of fields of their moments, or of some blocks; weights are (...)."""

    def weigh_field(field: str) -> Array:
        """Weighted sum of a field, of shape (...) followed by the shape of the field."""
        total: Any = 0.0
        for key, part in model.parts.items():
            total += np.multiply.outer(weights[key], np.asarray(getattr(part, field))[here])
        return np.asarray(total)

    return list(map(weigh_field, fields))


def _squares_of_spread(
    part: Moments, posterior: Posterior, here: tuple[slice, slice], cross_covariance: Array, covariance: Array
) -> float:
    """Contribution of the spread of some blocks' errors to a part's expected sum of squares."""
    x, u = scales(posterior.logs, posterior.model.of_columns), scales(posterior.logs, posterior.model.of_errors[here])
    by_x = (cross_covariance.reshape(-1, len(x)) * x).reshape(cross_covariance.shape)
    cross_term = np.vdot(u, np.vecdot(part.errors_fixed[here], by_x))
    own_term = np.vdot(u, np.vecdot(part.errors_errors[*here, here[1]], u[:, None, :] * covariance))
    return float(own_term - 2 * cross_term)


def _part_moments(part: Moments, posterior: Posterior) -> tuple[float, Array, Array]:
    """A part's cost at the mean, at unit sigma, and half its gradients in columns, (m,), and errors, (b, q)."""
    x, u = scales(posterior.logs, posterior.model.of_columns), scales(posterior.logs, posterior.model.of_errors)
    at_x, at_u = posterior.mean_columns * x, posterior.mean_errors * u
    by_x = part.fixed_fixed @ at_x + at_u.ravel() @ part.errors_fixed.reshape(-1, len(x))
    by_u = part.errors_fixed @ at_x + (part.errors_errors @ at_u[..., None])[..., 0]
    squares = part.cost + at_x @ (2 * part.fixed + by_x) + np.sum(at_u * (2 * part.errors + by_u))
    return float(squares), x * (part.fixed + by_x), u * (part.errors + by_u)
