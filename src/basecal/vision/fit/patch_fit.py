"""Least squares of a shape to many small pieces of an image at once.

A piece is `gain * shape(q, xy) + offset (+ slope. xy)`. The shape's own parameters q are sought. Gain, offset and slope
belong to the illumination, and are solved for along the way. Each piece is a problem of its own.
Source: Golub & Pereyra 1973 (variable projection), in Kaufman's form.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from basecal.geometry import Array, BoolArray, IntArray
from basecal.numerics.levenberg_marquardt import Quadratic, Stop, levenberg_marquardt

_FIT_ROUNDS = 30  # half of the pieces need five, one in thirty more than these
_RIDGE = 1e-9  # of the diagonal: what one grey level of noise leaves undetermined stays finite

CONVERGED_SIGMAS = 1e-3
"""Of the residuals' norm: a step that gains less than a millionth of the cost is the last."""


class Shape(Protocol):
    """Values as a function of place, by parameters, each of which should count in pixels, radians or a logarithm."""

    def __call__(self, q: Array, xy: Array) -> Array:
        """Values, (n, p), by parameters, (n, k), at places, (n, p, 2) [px]."""

    def linearise_shape(self, q: Array, xy: Array, free: int) -> tuple[Array, Array]:
        """Values, (n, p), and their derivatives to the first `free` parameters, (n, free, p)."""


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
        light: Gain and offset, and slopes if requested, (n, 2) or (n, 4).
        covariance: Of what is free in `shape`, if 1 / weight is the variance of a pixel, (n, k, k).
        residuals: Levels beyond the fit, (n, p).
        converged: (n,).
    """

    shape: Array
    light: Array
    covariance: Array
    residuals: Array
    converged: BoolArray


def pack_patches(patches: Patches, weights: Array) -> Patches:
    """The pixels that weigh anything, in as many columns as the piece with most of them has, with those weights."""
    most = max(int((weights > 0).sum(axis=1).max(initial=0)), 1)
    kept = np.argsort(weights == 0, axis=1, kind="stable")[:, :most]
    rows = np.arange(len(kept))[:, None]
    return Patches(patches.xy[rows, kept], patches.values[rows, kept], weights[rows, kept])


def fit_shapes(
    shape: Shape,
    start: Array,
    patches: Patches,
    has_slope: bool = False,
    held_count: int = 0,
    tolerance: float = CONVERGED_SIGMAS,
) -> Fit:
    """The shapes nearest to pieces of an image.

    Args:
        shape: The model.
        start: Its parameters to begin with, (n, k).
        patches: The pieces.
        has_slope: Whether the light may change linearly across a piece.
        held_count: How many of the last parameters stay as they are.
        tolerance: What may be left to go, of the residuals' norm.
    """
    pieces = _Pieces(shape, patches, has_slope, start.shape[1] - held_count)
    optima = levenberg_marquardt(pieces, start, Stop(_FIT_ROUNDS, sigmas=tolerance))
    lit = pieces.fit_light(shape(optima.state, patches.xy))
    covariance = np.asarray(np.linalg.inv(_add_ridge(optima.about.hessian)), dtype=np.float64)
    return Fit(optima.state, lit.light, covariance, lit.residuals, optima.converged)


class _Lit(NamedTuple):
    """Pieces in their best light: of the light its rows (n, 2 or 4, p) and itself, and the residuals (n, p)."""

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
        free, weights = self.free, self.patches.weights
        values, derivatives = self.shape.linearise_shape(q, self.patches.xy, free)
        lit = self.fit_light(values)
        jacobian = np.concatenate([lit.light[:, :1, None] * derivatives, lit.basis], axis=1)
        weighted = jacobian * weights[:, None]
        normal = weighted @ np.swapaxes(jacobian, 1, 2)
        mixed = normal[:, free:, :free]
        hessian = normal[:, :free, :free] - np.swapaxes(mixed, 1, 2) @ _solve_systems(normal[:, free:, free:], mixed)
        gradient = -(weighted[:, :free] @ lit.residuals[..., None])[..., 0]
        return Quadratic((weights * lit.residuals**2).sum(axis=1), gradient, hessian)

    def retract(self, q: Array, model: Quadratic, step: Array) -> Array:
        """See `System`."""
        return q + np.pad(step, ((0, 0), (0, q.shape[1] - step.shape[1])))

    def take(self, rows: IntArray) -> _Pieces:
        """See `System`."""
        return _Pieces(self.shape, self.patches[rows], self.sloped, self.free)

    def fit_light(self, values: Array) -> _Lit:
        """The pieces about values of their shapes, (n, p), in the light that suits them best."""
        patches = self.patches
        slopes = [patches.xy[..., 0], patches.xy[..., 1]] if self.sloped else []
        basis = np.stack([values, np.ones_like(values), *slopes], axis=1)
        weighted = basis * patches.weights[:, None]
        light = _solve_systems(weighted @ np.swapaxes(basis, 1, 2), weighted @ patches.values[..., None])[..., 0]
        return _Lit(basis, light, patches.values - (light[:, None] @ basis)[:, 0])


def _solve_systems(matrix: Array, right: Array) -> Array:
    """Solutions of positive semidefinite systems, (n, k, m), barely regularised in their own units."""
    return np.asarray(np.linalg.solve(_add_ridge(matrix), right))


def _add_ridge(matrix: Array) -> Array:
    """Matrices with their diagonals raised by a trace alone."""
    diagonal = np.diagonal(matrix, axis1=1, axis2=2)
    raised = _RIDGE * diagonal + 1e-12 * diagonal.max(axis=1, keepdims=True) + 1e-300
    return np.asarray(matrix + raised[..., None] * np.eye(matrix.shape[1]))
