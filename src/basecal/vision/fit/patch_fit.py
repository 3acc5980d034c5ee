"""Least squares of a shape to many small pieces of an image at once.

A piece is `gain * shape(q, xy) + offset (+ slope . xy)`: the shape's own parameters q are what is sought, gain,
offset and slope are the light's and solved for along the way. Each piece takes its own damped Gauss-Newton steps.
Source: Golub & Pereyra 1973 (variable projection), in Kaufman's form.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from basecal.geometry import Array, BoolArray, IntArray

_DIFFERENCE = 1e-5
_ROUNDS = 25
_SETTLED = 1e-4
_LEVEL = 1e-6
_LEAST_DAMPING = 1e-5
_RIDGE = 1e-9

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
        leverage: Share of a pixel's own noise that the fit follows, (n, p), in [0, 1].
        converged: (n,).
    """

    shape: Array
    light: Array
    covariance: Array
    residuals: Array
    leverage: Array
    converged: BoolArray


class _At(NamedTuple):
    """A linearisation: residuals (n, p), their negative Jacobian to shape and light (n, p, k + l), light (n, l)."""

    residuals: Array
    jacobian: Array
    light: Array
    cost: Array


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
    free = start.shape[1] - held
    q, damping = start.copy(), np.full(len(start), 1e-3)
    settled = np.zeros(len(start), dtype=bool)
    at = _linearised(shape, q, patches, sloped, free)
    for _ in range(_ROUNDS):
        rows = np.flatnonzero(~settled)
        if not len(rows):
            break
        here = _At(*(part[rows] for part in at))
        step = _step(here, patches[rows].weights, damping[rows], free)
        there = _linearised(shape, _stepped(q[rows], step), patches[rows], sloped, free)
        better = there.cost <= here.cost
        damping[rows] = np.where(better, np.maximum(damping[rows] / 10, _LEAST_DAMPING), damping[rows] * 10)
        level = better & (here.cost - there.cost < _LEVEL * here.cost)
        settled[rows] = level | (np.abs(step).max(axis=1) < _SETTLED)
        q[rows[better]] = _stepped(q[rows[better]], step[better])
        for part, new in zip(at, there, strict=True):
            part[rows[better]] = new[better]
    return _fit(q, at, patches.weights, settled, free)


def _stepped(q: Array, step: Array) -> Array:
    return q + np.pad(step, ((0, 0), (0, q.shape[1] - step.shape[1])))


def _linearised(shape: Shape, q: Array, patches: Patches, sloped: bool, free: int) -> _At:
    values = shape(q, patches.xy)
    ones = np.ones_like(values)
    slopes = [patches.xy[..., 0], patches.xy[..., 1]] if sloped else []
    basis = np.stack([values, ones, *slopes], axis=-1)
    weighted = np.swapaxes(basis * patches.weights[..., None], 1, 2)
    light = _solved(weighted @ basis, (weighted @ patches.values[..., None])[..., 0])
    residuals = patches.values - (basis @ light[..., None])[..., 0]
    moved = (shape(q + _DIFFERENCE * unit, patches.xy) - values for unit in np.eye(free, q.shape[1]))
    gain = light[:, :1] / _DIFFERENCE
    jacobian = np.concatenate([np.stack([gain * each for each in moved], axis=-1), basis], axis=-1)
    return _At(residuals, jacobian, light, (patches.weights * residuals**2).sum(axis=1))


def _solved(matrix: Array, right: Array) -> Array:
    """Solutions of positive semidefinite systems, (n, k), barely regularised in their own units."""
    return np.asarray(np.linalg.solve(_ridged(matrix, _RIDGE), right[..., None])[..., 0])


def _ridged(matrix: Array, ridge: float | Array) -> Array:
    """Matrices with their diagonals raised by a share of themselves."""
    diagonal = np.diagonal(matrix, axis1=1, axis2=2)
    raised = np.asarray(ridge)[..., None] * diagonal + 1e-12 * diagonal.max(axis=1, keepdims=True) + 1e-300
    return np.asarray(matrix + raised[..., None] * np.eye(matrix.shape[1]))


def _step(at: _At, weights: Array, damping: Array, shape_size: int) -> Array:
    weighted = np.swapaxes(at.jacobian * weights[..., None], 1, 2)
    normal = _ridged(weighted @ at.jacobian, damping)
    right = (weighted @ at.residuals[..., None])[..., 0]
    return np.asarray(np.linalg.solve(normal, right[..., None])[:, :shape_size, 0])


def _fit(q: Array, at: _At, weights: Array, settled: BoolArray, free: int) -> Fit:
    weighted = at.jacobian * weights[..., None]
    covariance = np.asarray(np.linalg.inv(_ridged(np.swapaxes(weighted, 1, 2) @ at.jacobian, _RIDGE)), dtype=np.float64)
    leverage = np.einsum("npi,nij,npj->np", weighted, covariance, at.jacobian, optimize=True)
    return Fit(q, at.light, covariance[:, :free, :free], at.residuals, leverage.clip(0, 1), settled)
