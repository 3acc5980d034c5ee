"""Fit of a Gaussian spot to an image patch, weighted by the noise in the patch.

By shot noise the variance of a pixel is linear in its level; both coefficients are estimated from the residuals. The
spot is integrated over each pixel's square, which gives a product of a factor along x and one along y.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.linalg.lapack import dposv
from scipy.special import ndtr

from basecal.geometry import Array, BoolArray, IntArray
from basecal.numerics.levenberg_marquardt import Criteria, Quadratic, levenberg_marquardt

_ROUNDING_VARIANCE = 1 / 12
_ROUGH_ROUNDS = 12  # twice the number for an initial error of one pixel
_ROUGH_SIGMAS = 1.0  # tolerance of the unweighted fit; the weighted rounds then converge to 1e-6 px
_WEIGHTED_ROUNDS = 3
_MOST_LOG_WIDTH = 5.0  # largest absolute log width in pixels: beyond, the patch has no spot
_DENSITY = 1 / math.sqrt(2 * math.pi)
_UNIT_ROWS = np.eye(6)


class Spot(NamedTuple):
    """A spot: x, y [px] in the patch, sigma of the position per coordinate [px], widths in x, y [px], brightness."""

    x: float
    y: float
    sigma_px: float
    width_x: float
    width_y: float
    brightness: float


class _Linearisation(NamedTuple):
    """Levels of the spot without background, (p,), residuals, (p,), and the Jacobian, (6, p), at parameters."""

    level: Array
    residuals: Array
    jacobian: Array


def fit_spot(levels: Array, mask: BoolArray, start: tuple[float, float, float]) -> Spot | None:
    """Fit a spot to an image patch; None if the fit fails.

    Args:
        levels: Grey levels, (h, w).
        mask: Pixels to use, (h, w).
        start: Initial x, y and width [px].
    """
    x, y, width = start
    offset = float(np.median(levels))
    q = np.array([x, y, np.log(width), np.log(width), max(float((levels - offset).sum()), 1.0), offset])
    weights = mask.ravel().astype(np.float64)
    if weights.sum() < 2 * len(q):
        return None
    stop = Criteria(_ROUGH_ROUNDS, max(float(weights.sum()) - len(q), 1.0), tolerance=_ROUGH_SIGMAS)
    q = levenberg_marquardt(_SpotSystem(levels, weights), q[None], stop).state[0]
    linearisation = _linearise_spot(q, levels)
    covariance = _inverse((linearisation.jacobian * weights) @ linearisation.jacobian.T)
    for _ in range(_WEIGHTED_ROUNDS):
        if covariance is None:
            return None
        weights = np.where(weights > 0, 1 / _variance(linearisation, weights, covariance), 0.0)
        weighted = linearisation.jacobian * weights
        covariance = _inverse(weighted @ linearisation.jacobian.T)
        if covariance is not None:
            q = q + covariance @ (weighted @ linearisation.residuals)
            linearisation = _linearise_spot(q, levels)
    if covariance is None or not np.all(np.isfinite(q)) or np.abs(q[2:4]).max() > _MOST_LOG_WIDTH:
        return None
    sigma = np.sqrt((covariance[0, 0] + covariance[1, 1]) / 2 * _variance_factor(linearisation, weights))
    x, y, log_width_x, log_width_y, brightness, _ = q.tolist()
    return Spot(x, y, float(sigma), math.exp(log_width_x), math.exp(log_width_y), brightness)


def _variance_factor(linearisation: _Linearisation, weights: Array) -> float:
    """Factor of the position's variance, since the noise is estimated from few pixels.

    The factor is that of Student's t distribution, with the effective number of pixels that determine the position as
    degrees of freedom.
    """
    information = weights * (linearisation.jacobian[0] ** 2 + linearisation.jacobian[1] ** 2)
    freedom = max(float(information.sum() ** 2 / (information @ information)), 4.0)
    return freedom / (freedom - 2)


def _inverse(matrix: Array) -> Array | None:
    """Inverse of a symmetric positive definite matrix; None for others. Calls LAPACK directly, as NumPy is slower."""
    _, inverse, failed = dposv(matrix, _UNIT_ROWS)
    return None if failed else np.asarray(inverse)


@dataclass(frozen=True, eq=False)
class _SpotSystem:
    """A patch with fixed weights, as a `System` with a batch of one for Levenberg-Marquardt."""

    levels: Array
    weights: Array

    def linearise(self, q: Array) -> Quadratic:
        """See `System`."""
        linearisation = _linearise_spot(q[0], self.levels)
        weighted = linearisation.jacobian * self.weights
        cost = self.weights @ linearisation.residuals**2
        return Quadratic(
            cost[None], -(weighted @ linearisation.residuals)[None], (weighted @ linearisation.jacobian.T)[None]
        )

    def retract(self, q: Array, model: Quadratic, step: Array) -> Array:
        """See `System`."""
        return q + step

    def take(self, rows: IntArray) -> _SpotSystem:
        """See `System`."""
        return self


def _linearise_spot(q: Array, levels: Array) -> _Linearisation:
    height, width = levels.shape
    (across, d_x, d_width), (down, d_y, d_height) = _shares(q[0], q[2], width), _shares(q[1], q[3], height)
    brightness = q[4]
    jacobian = np.empty((6, height, width))
    bright_down, column = brightness * down[:, None], down[:, None]
    np.multiply(bright_down, d_x, out=jacobian[0])
    np.multiply((brightness * d_y)[:, None], across, out=jacobian[1])
    np.multiply(bright_down, d_width, out=jacobian[2])
    np.multiply((brightness * d_height)[:, None], across, out=jacobian[3])
    np.multiply(column, across, out=jacobian[4])
    jacobian[5] = 1.0
    flat = jacobian.reshape(6, -1)
    level = brightness * flat[4]
    return _Linearisation(level, levels.ravel() - level - q[5], flat)


def _shares(centre: float, log_width: float, count: int) -> tuple[Array, Array, Array]:
    """Shares of a spot in `count` pixels along an axis, with derivatives with respect to centre and log width."""
    inverse = math.exp(-min(max(log_width, -_MOST_LOG_WIDTH), _MOST_LOG_WIDTH))
    borders = (np.arange(count + 1) - (0.5 + centre)) * inverse
    share = ndtr(borders)
    density = _DENSITY * np.exp(-0.5 * borders * borders)
    d_width = borders * density
    return share[1:] - share[:-1], inverse * (density[:-1] - density[1:]), d_width[:-1] - d_width[1:]


def _variance(linearisation: _Linearisation, weights: Array, covariance: Array) -> Array:
    """Variance of each pixel, (p,), linear in the spot's level: maximum likelihood by Fisher scoring.

    Squared residuals are corrected by the leverage of their pixels.
    """
    leverage = weights * ((covariance @ linearisation.jacobian) * linearisation.jacobian).sum(axis=0)
    level, count = np.maximum(linearisation.level, 0.0), weights > 0
    squared = linearisation.residuals**2 / np.maximum(1 - leverage, 0.05)
    dark = count & (level < 0.02 * level.max())
    floor, slope = (
        max(float(squared[dark].mean() if dark.sum() > 8 else np.median(squared[count])), _ROUNDING_VARIANCE),
        0.0,
    )
    basis = np.stack([np.ones_like(level), level, level**2, squared, level * squared], axis=1)
    for _ in range(3):
        s0, s1, s2, t0, t1 = ((count / (floor + slope * level) ** 2) @ basis).tolist()
        determinant = max(s0 * s2 - s1 * s1, 1e-300)
        floor = max((s2 * t0 - s1 * t1) / determinant, _ROUNDING_VARIANCE)
        slope = max((s0 * t1 - s1 * t0) / determinant, 0.0)
    return np.asarray(floor + slope * level)
