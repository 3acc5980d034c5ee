"""Least-squares fit of a shape to many image patches as a batch.

The model of a patch is `gain * shape(q, xy) + offset (+ slope. xy)`. The parameters q of the shape are estimated. Gain,
offset and slope describe the illumination and are eliminated. Each patch is an independent problem.
Source: Golub & Pereyra 1973 (variable projection), in Kaufman's form.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from basecal.geometry import Array, BoolArray, IntArray
from basecal.numerics.levenberg_marquardt import Criteria, Quadratic, levenberg_marquardt

_FIT_ROUNDS = 30  # half of the patches need five, one in thirty more than 30
_RIDGE = 1e-9  # of the diagonal: keeps undetermined parameters finite

CONVERGED_SIGMAS = 1e-3
"""Convergence tolerance relative to the residuals' norm: a step that gains less than 1e-6 of the cost is the last."""


class Shape(Protocol):
    """A function of position and parameters, each parameter in pixels, radians or as a logarithm."""

    def __call__(self, q: Array, xy: Array) -> Array:
        """Values, (n, p), for parameters, (n, k), at positions, (n, p, 2) [px]."""

    def linearise_shape(self, q: Array, xy: Array, free: int) -> tuple[Array, Array]:
        """Values, (n, p), and their derivatives with respect to the first `free` parameters, (n, free, p)."""


@dataclass(frozen=True, eq=False)
class Patches:
    """Image patches.

    Attributes:
        xy: Positions of pixels, (n, p, 2) [px], relative to the origin of the patch's shape.
        values: Grey levels, (n, p).
        weights: 1 / variance up to a common factor, (n, p); 0 excludes a pixel.
    """

    xy: Array
    values: Array
    weights: Array

    def __getitem__(self, rows: IntArray) -> Patches:
        return Patches(self.xy[rows], self.values[rows], self.weights[rows])


@dataclass(frozen=True, eq=False)
class Fit:
    """Shapes fitted to patches.

    Attributes:
        shape: Parameters of the shapes, (n, k).
        light: Gain and offset, and slopes if requested, (n, 2) or (n, 4).
        covariance: Covariance of the free parameters, if 1 / weight is the variance of a pixel, (n, free, free).
        residuals: Levels minus the fit, (n, p).
        converged: Whether each fit converged, (n,).
    """

    shape: Array
    light: Array
    covariance: Array
    residuals: Array
    converged: BoolArray


def pack_patches(patches: Patches, weights: Array) -> Patches:
    """Pack the pixels with positive weights into as few columns as the patch with the most such pixels needs."""
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
    """Fit shapes to image patches by least squares.

    Args:
        shape: The model.
        start: Initial parameters, (n, k).
        patches: The patches.
        has_slope: Whether the illumination may vary linearly across a patch.
        held_count: Number of last parameters that are fixed.
        tolerance: Convergence tolerance relative to the residuals' norm.
    """
    system = _PatchSystem(shape, patches, has_slope, start.shape[1] - held_count)
    optima = levenberg_marquardt(system, start, Criteria(_FIT_ROUNDS, tolerance=tolerance))
    lit = system.fit_light(shape(optima.state, patches.xy))
    covariance = np.asarray(np.linalg.inv(_add_ridge(optima.linearisation.hessian)), dtype=np.float64)
    return Fit(optima.state, lit.light, covariance, lit.residuals, optima.converged)


class _Illuminated(NamedTuple):
    """Patches with fitted illumination: its basis (n, 2 or 4, p), its coefficients (n, 2 or 4), residuals (n, p)."""

    basis: Array
    light: Array
    residuals: Array


@dataclass(frozen=True, eq=False)
class _PatchSystem:
    """Patches and the first `free` parameters of their shapes, as a `System` for Levenberg-Marquardt."""

    shape: Shape
    patches: Patches
    sloped: bool
    free: int

    def linearise(self, q: Array) -> Quadratic:
        """See `System`; the illumination is eliminated."""
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

    def take(self, rows: IntArray) -> _PatchSystem:
        """See `System`."""
        return _PatchSystem(self.shape, self.patches[rows], self.sloped, self.free)

    def fit_light(self, values: Array) -> _Illuminated:
        """Fit the illumination for given values of the shapes, (n, p)."""
        patches = self.patches
        slopes = [patches.xy[..., 0], patches.xy[..., 1]] if self.sloped else []
        basis = np.stack([values, np.ones_like(values), *slopes], axis=1)
        weighted = basis * patches.weights[:, None]
        light = _solve_systems(weighted @ np.swapaxes(basis, 1, 2), weighted @ patches.values[..., None])[..., 0]
        return _Illuminated(basis, light, patches.values - (light[:, None] @ basis)[:, 0])


def _solve_systems(matrix: Array, right: Array) -> Array:
    """Solve positive semidefinite systems, (n, k, m), with a slight regularisation in the units of each."""
    return np.asarray(np.linalg.solve(_add_ridge(matrix), right))


def _add_ridge(matrix: Array) -> Array:
    """Matrices with slightly increased diagonals."""
    diagonal = np.diagonal(matrix, axis1=1, axis2=2)
    raised = _RIDGE * diagonal + 1e-12 * diagonal.max(axis=1, keepdims=True) + 1e-300
    return np.asarray(matrix + raised[..., None] * np.eye(matrix.shape[1]))
