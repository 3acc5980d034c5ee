"""Rank, null space and pseudo-inverse: what of a matrix is information and what is rounding.

Information matrices are scaled to a unit diagonal first, since metres, radians and pixels of a lens stand side by side:
then eigenvalues compare what the data hold of combinations with what they hold of the unknowns themselves.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from basecal.geometry import Array, BoolArray, IntArray

ROUNDING = 1e-12  # eigenvalue over the largest, of information: J'J loses 1e-16 of it per row, some thousands of them
# Likewise of one view: moments about an origin twenty targets away round at 2e-13, what two points hold is above 1e-6.
VIEW_ROUNDING = 1e-9
INDEPENDENT = 1e-9  # singular value over the largest, of columns that are exact but for rounding of 1e-16 a product
FLAT = 1e-6  # extent over the largest: a micrometre on a metre is no depth, and ten orders above rounding
_NOTHING = 1e-300  # keeps quotients of zeros finite


@dataclass(frozen=True, eq=False)
class Spectrum:
    """Symmetric positive semidefinite matrices (..., k, k) taken apart: `D V diag(values) V' D` with D of `scale`.

    Attributes:
        values: (..., k) eigenvalues after scaling, rising.
        vectors: (..., k, k) the eigenvectors, a column each.
        scale: (..., k) what one scaled unit multiplies each row and column by.
        held: (..., k) which eigenvalues are information, not rounding.
    """

    values: Array
    vectors: Array
    scale: Array
    held: BoolArray

    @property
    def rank(self) -> IntArray:
        """(...,) how many directions hold information."""
        return np.asarray(np.count_nonzero(self.held, axis=-1), dtype=np.int64)

    @cached_property
    def root(self) -> Array:
        """R, (..., k, k), with `R @ R'` the matrix; zero columns along directions without information."""
        size = np.where(self.held, np.sqrt(np.maximum(self.values, 0.0)), 0.0)
        return np.asarray(self.vectors * self.scale[..., :, None] * size[..., None, :])

    @cached_property
    def inverse_root(self) -> Array:
        """Q, (..., k, k), with `Q @ Q'` the pseudo-inverse, in the scaled metric; zero columns likewise."""
        size = np.where(self.held, 1 / np.sqrt(np.where(self.held, self.values, 1.0)), 0.0)
        return np.asarray(self.vectors / self.scale[..., :, None] * size[..., None, :])

    @property
    def inverse(self) -> Array:
        """The inverse, (..., k, k), zero along directions without information."""
        return np.asarray(self.inverse_root @ np.swapaxes(self.inverse_root, -1, -2))


def spectrum(information: Array, rounding: float = ROUNDING) -> Spectrum:
    """Information matrices (..., k, k) taken apart, scaled to a unit diagonal.

    Args:
        information: Symmetric, positive semidefinite but for rounding.
        rounding: Share of the largest eigenvalue up to which one is none.
    """
    diagonal = np.sqrt(np.maximum(np.diagonal(information, axis1=-2, axis2=-1), 0.0))
    scale = np.where(diagonal > 0, diagonal, 1.0)
    if not information.shape[-1]:
        return Spectrum(diagonal, np.zeros(information.shape), scale, np.zeros(diagonal.shape, dtype=bool))
    values, vectors = np.linalg.eigh(information / scale[..., :, None] / scale[..., None, :])
    return Spectrum(values, vectors, scale, holds_information(values, rounding))


def holds_information(values: Array, rounding: float = ROUNDING) -> BoolArray:
    """Which eigenvalues, (..., k) rising, are more than rounding of the largest."""
    return np.asarray(values > rounding * np.maximum(values[..., -1:], _NOTHING))


def independent(values: Array) -> int:
    """The rank that singular values, (k,) falling, of exact columns show."""
    return int(np.count_nonzero(values > INDEPENDENT * np.max(values, initial=_NOTHING)))


def least_norm(rows: Array, right: Array) -> Array:
    """The smallest of the least-squares solutions of `rows @ x = right`, (m, k) and (m,) to (k,)."""
    return np.asarray(np.linalg.lstsq(rows, right, rcond=INDEPENDENT)[0], dtype=np.float64)


def dimension(points: Array) -> int:
    """How many dimensions points (p, 3) span: 0 where all are one, 1 on a line, 2 in a plane, else 3."""
    if not len(points):
        return 0
    extents = np.linalg.svd(points - points.mean(0), compute_uv=False)
    return int(np.count_nonzero(extents > FLAT * np.max(extents, initial=_NOTHING))) if extents[0] > 0 else 0
