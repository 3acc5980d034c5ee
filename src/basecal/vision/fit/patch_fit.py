"""Least squares of a shape to many small pieces of an image at once.

A piece is `gain * shape(q, xy) + offset (+ slope . xy)`: the shape's own parameters q are what is sought, gain,
offset and slope are the light's and solved for along the way. Each piece is a problem of its own.
Source: Golub & Pereyra 1973 (variable projection), in Kaufman's form.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from basecal.geometry import Array, BoolArray, IntArray
from basecal.numerics.levenberg_marquardt import Quadratic, Stop, levenberg_marquardt

_DIFFERENCE = 1e-5  # [px, rad, log]: the derivative's curvature and the values' rounding are both far below noise
_ROUNDS = 30  # half of the pieces need five, one in thirty more than these
_SETTLED = 1e-3  # of the residuals' norm: a step that gains less than a millionth of the cost is the last
_RIDGE = 1e-9  # of the diagonal: what one grey level of noise leaves undetermined stays finite

Shape = Callable[[Array, Array], Array]
"""From parameters, (n, k), and places, (n, p, 2) [px], to values, (n, p)."""


@dataclass(frozen=True, eq=False)
class Patches:
    """Pieces of an image.

    Attributes:
        xy: Places of pixels, (n, p, 2) [px] from wherever the piece's shape counts.
        values: Grey levels, (n, p).
        weights: 1 / variance up to a common factor, (n, p); 0 leaves a pixel out.
    """

    xy: Array
    values: Array
    weights: Array

    def __getitem__(self, rows: IntArray) -> Patches:
        return Patches(self.xy[rows], self.values[rows], self.weights[rows])


@dataclass(frozen=True, eq=False)
class Fit:
    """Shapes fitted to pieces.

    Attributes:
        shape: Parameters of the shapes, (n, k).
        light: Gain and offset, and slopes if asked for, (n, 2) or (n, 4).
        covariance: Of what is free in `shape`, if 1 / weight is the variance of a pixel, (n, k, k).
        residuals: Levels beyond the fit, (n, p).
        converged: (n,).
    """

    shape: Array
    light: Array
    covariance: Array
    residuals: Array
    converged: BoolArray


def packed(patches: Patches, weights: Array) -> Patches:
    """The pixels that weigh anything, in as many columns as the piece with most of them has, with those weights."""
    most = max(int((weights > 0).sum(axis=1).max(initial=0)), 1)
    kept = np.argsort(weights == 0, axis=1, kind="stable")[:, :most]
    rows = np.arange(len(kept))[:, None]
    return Patches(patches.xy[rows, kept], patches.values[rows, kept], weights[rows, kept])


def fit_shapes(shape: Shape, start: Array, patches: Patches, sloped: bool = False, held: int = 0) -> Fit:
    """The shapes nearest to pieces of an image.

    Args:
        shape: The model.
        start: Its parameters to begin with, (n, k); each should count in pixels, radians or a logarithm.
        patches: The pieces.
        sloped: Whether the light may change linearly across a piece.
        held: How many of the last parameters stay as they are.
    """
    pieces = _Pieces(shape, patches, sloped, start.shape[1] - held)
    optima = levenberg_marquardt(pieces, start, Stop(_ROUNDS, sigmas=_SETTLED))
    lit = pieces.lit(optima.state)
    covariance = np.asarray(np.linalg.inv(_ridged(optima.about.hessian)), dtype=np.float64)
    return Fit(optima.state, lit.light, covariance, lit.residuals, optima.converged)


class _Lit(NamedTuple):
    """Pieces in their best light: values of the shape and residuals (n, p), of the light its columns and itself."""

    values: Array
    basis: Array
    light: Array
    residuals: Array


@dataclass(frozen=True, eq=False)
class _Pieces:
    """Pieces and the first `free` parameters of their shapes, as Levenberg-Marquardt knows them; see `System`."""

    shape: Shape
    patches: Patches
    sloped: bool
    free: int

    def linearise(self, q: Array) -> Quadratic:
        """See `System`; the light is eliminated."""
        lit, free = self.lit(q), self.free
        moved = (self.shape(q + _DIFFERENCE * unit, self.patches.xy) - lit.values for unit in np.eye(free, q.shape[1]))
        gain = lit.light[:, :1] / _DIFFERENCE
        jacobian = np.concatenate([np.stack([gain * each for each in moved], axis=-1), lit.basis], axis=-1)
        weighted = np.swapaxes(jacobian * self.patches.weights[..., None], 1, 2)
        normal = weighted @ jacobian
        mixed = normal[:, free:, :free]
        hessian = normal[:, :free, :free] - np.swapaxes(mixed, 1, 2) @ _solved(normal[:, free:, free:], mixed)
        gradient = -(weighted[:, :free] @ lit.residuals[..., None])[..., 0]
        return Quadratic((self.patches.weights * lit.residuals**2).sum(axis=1), gradient, hessian)

    def retract(self, q: Array, about: Quadratic, step: Array) -> Array:
        """See `System`."""
        return q + np.pad(step, ((0, 0), (0, q.shape[1] - step.shape[1])))

    def take(self, rows: IntArray) -> _Pieces:
        """See `System`."""
        return _Pieces(self.shape, self.patches[rows], self.sloped, self.free)

    def lit(self, q: Array) -> _Lit:
        """The pieces about shapes (n, k), in the light that suits them best."""
        patches = self.patches
        values = self.shape(q, patches.xy)
        ones = np.ones_like(values)
        slopes = [patches.xy[..., 0], patches.xy[..., 1]] if self.sloped else []
        basis = np.stack([values, ones, *slopes], axis=-1)
        weighted = np.swapaxes(basis * patches.weights[..., None], 1, 2)
        light = _solved(weighted @ basis, weighted @ patches.values[..., None])[..., 0]
        return _Lit(values, basis, light, patches.values - (basis @ light[..., None])[..., 0])


def _solved(matrix: Array, right: Array) -> Array:
    """Solutions of positive semidefinite systems, (n, k, m), barely regularised in their own units."""
    return np.asarray(np.linalg.solve(_ridged(matrix), right))


def _ridged(matrix: Array) -> Array:
    """Matrices with their diagonals raised by a trace of themselves."""
    diagonal = np.diagonal(matrix, axis1=1, axis2=2)
    raised = _RIDGE * diagonal + 1e-12 * diagonal.max(axis=1, keepdims=True) + 1e-300
    return np.asarray(matrix + raised[..., None] * np.eye(matrix.shape[1]))
