"""Rank, null space and pseudo-inverse of information matrices, with eigenvalues due to rounding removed.

Information matrices are scaled to a unit diagonal first, since they combine metres, radians and pixels of a lens.
Eigenvalues then compare the information about combinations with that about the single unknowns. Matrices with
meaningful units (shares of a variance, motions in radians) are not scaled, see `scaled_spectrum`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.linalg.lapack import dsyevr

from basecal.geometry import Array, BoolArray, IntArray
from basecal.geometry.rotation import lengths

# Relative eigenvalue below which information is rounding: J'J loses 1e-16 per row, with some thousands of rows.
ROUNDING = 1e-12
# The same for a single view: moments about an origin at 20 target sizes round at 2e-13; two points hold above 1e-6.
VIEW_ROUNDING = 1e-9
# Relative singular value of dependent columns that are exact except for rounding of 1e-16 per product.
INDEPENDENT_SHARE = 1e-9
FLAT_SHARE = 1e-6  # relative extent: a micrometre on a metre is flat, but ten orders of magnitude above rounding
NULL_GAP = 0.35  # largest ratio of a null vector's singular value to the next: two null vectors have similar values
_SECOND_NULL_SHARE = 1e-3  # next singular value of rows of unit size, below which the null vector is not unique
_SMALLEST_DIVISOR = 1e-300  # keeps quotients of zeros finite
_RIDGE, _SMALLEST_RIDGE = 1e-15, 1e-100  # relative to the trace, and absolute: makes a singular matrix invertible
_SQUARINGS = 4


@dataclass(frozen=True, eq=False)
class Spectrum:
    """Decomposition of symmetric positive semidefinite matrices (..., k, k): `D V diag(values) V' D`, D = diag(scale).

    Attributes:
        values: (..., k) eigenvalues after scaling, increasing.
        vectors: (..., k, k) eigenvectors as columns.
        scale: (..., k) factor of each row and column.
        is_informative: (..., k) whether each eigenvalue is information, not rounding.
    """

    values: Array
    vectors: Array
    scale: Array
    is_informative: BoolArray

    @property
    def rank(self) -> IntArray:
        """Number of directions with information, (...,)."""
        return np.asarray(np.count_nonzero(self.is_informative, axis=-1), dtype=np.int64)

    @cached_property
    def root(self) -> Array:
        """Factor R, (..., k, k), with `R @ R'` the matrix; zero columns for directions without information."""
        size = np.where(self.is_informative, np.sqrt(np.maximum(self.values, 0.0)), 0.0)
        return np.asarray(self.vectors * self.scale[..., :, None] * size[..., None, :])

    @cached_property
    def inverse_root(self) -> Array:
        """Factor Q, (..., k, k), with `Q @ Q'` the pseudo-inverse in the scaled metric.

        Columns of directions without information are zero.
        """
        size = np.where(self.is_informative, 1 / np.sqrt(np.where(self.is_informative, self.values, 1.0)), 0.0)
        return np.asarray(self.vectors / self.scale[..., :, None] * size[..., None, :])

    @property
    def inverse(self) -> Array:
        """Pseudo-inverse, (..., k, k), zero in directions without information."""
        return np.asarray(self.inverse_root @ self.inverse_root.mT)

    def inverse_with_ridge(self, ridge: float) -> Array:
        """Inverse `(M + ridge)^-1`, (..., k, k), in the directions with information; zero in the others.

        Computed as `Q (1 + ridge Q' Q)^-1 Q'` from the eigenvalues of `ridge Q' Q`. This is stable for any sizes of the
        ridge and the matrix.
        """
        root = self.inverse_root
        if not root.size:
            return root
        values, vectors = np.linalg.eigh(ridge * (root.mT @ root))
        directions = root @ vectors
        return np.asarray((directions / (1 + np.maximum(values, 0.0))[..., None, :]) @ directions.mT)

    @property
    def log_det(self) -> Array:
        """Log pseudo-determinant, (...,): over the directions with information."""
        logs = np.log(np.where(self.is_informative, self.values, 1.0)).sum(-1)
        return np.asarray(logs + 2 * np.log(self.scale).sum(-1))

    def add_ridge(self, share: float) -> Spectrum:
        """Return a copy with a share of the largest eigenvalue added to all eigenvalues.

        A hard threshold on eigenvalues changes the set of directions abruptly if an eigenvalue is near it. With a
        ridge, each direction has the weight old / new eigenvalue, which changes smoothly.
        """
        values = np.maximum(self.values, 0.0)
        values_with_ridge = values + share * np.maximum(values[..., -1:], _SMALLEST_DIVISOR)
        return replace(self, values=values_with_ridge, is_informative=np.ones(self.is_informative.shape, dtype=bool))

    def squared_mahalanobis(self, vector: Array) -> Array:
        """Squared Mahalanobis norms `v' M^+ v` of vectors (..., k), (...,)."""
        along = (self.vectors.mT @ (vector / self.scale)[..., None])[..., 0]
        return np.asarray(
            np.sum(np.where(self.is_informative, along**2 / np.where(self.is_informative, self.values, 1.0), 0.0), -1)
        )


def spectrum(information: Array, rounding: float = ROUNDING) -> Spectrum:
    """Decompose information matrices (..., k, k), scaled to a unit diagonal.

    Args:
        information: Symmetric, positive semidefinite except for rounding.
        rounding: Share of the largest eigenvalue up to which an eigenvalue is rounding.
    """
    diagonal = np.sqrt(np.maximum(np.diagonal(information, axis1=-2, axis2=-1), 0.0))
    scale = np.where(diagonal > 0, diagonal, 1.0)
    if not information.size:
        return Spectrum(diagonal, np.zeros(information.shape), scale, np.zeros(diagonal.shape, dtype=bool))
    values, vectors = np.linalg.eigh(information / scale[..., :, None] / scale[..., None, :])
    return Spectrum(values, vectors, scale, holds_information(values, rounding))


def scaled_spectrum(matrix: Array, least: float | Array, scale: Array | None = None) -> Spectrum:
    """Decompose symmetric matrices (..., k, k) in given units; eigenvalues up to `least` hold no information.

    Eigenvalues within rounding of the largest hold no information either.

    Args:
        matrix: Symmetric, positive semidefinite except for rounding.
        least: Threshold of eigenvalues, in units of the matrix divided by `scale` squared.
        scale: (..., k) factor of each row and column; 1 if None.
    """
    scaled = matrix if scale is None else matrix / scale[..., :, None] / scale[..., None, :]
    scale = np.ones(matrix.shape[:-1]) if scale is None else scale
    if not matrix.size:
        return Spectrum(scale, matrix, scale, np.zeros(scale.shape, dtype=bool))
    values, vectors = np.linalg.eigh(scaled)
    return Spectrum(values, vectors, scale, (values > least) & holds_information(values))


def floored_spectrum(matrix: Array, least: float | Array) -> Spectrum:
    """Decompose symmetric matrices (..., k, k), with eigenvalues below `least` raised to `least`: always regular."""
    decomposed = scaled_spectrum(matrix, least)
    return replace(
        decomposed,
        values=np.maximum(decomposed.values, least),
        is_informative=np.ones(decomposed.is_informative.shape, dtype=bool),
    )


def floored_inverse(matrix: Array, least: float) -> Array:
    """Inverse of the matrix of `floored_spectrum`; decomposes only if an eigenvalue is below the floor.

    The floor is `least`, or the rounding of the trace if that is larger: the inverse of smaller eigenvalues could have
    negative variances.
    """
    floor = np.maximum(least, ROUNDING * np.trace(matrix, axis1=-2, axis2=-1))[..., None]
    try:
        np.linalg.cholesky(matrix - floor[..., None] * np.eye(matrix.shape[-1]))
    except np.linalg.LinAlgError:
        return floored_spectrum(matrix, floor).inverse
    return np.asarray(np.linalg.inv(matrix), dtype=np.float64)


def inverse_beside_identity(matrix: Array) -> Array:
    """Inverse `(1 + M)^-1` of symmetric, positive semidefinite M, (..., k, k); stable also for very large M."""
    values, vectors = np.linalg.eigh(matrix)
    return np.asarray((vectors / (1 + np.maximum(values, 0.0))[..., None, :]) @ vectors.mT)


def holds_information(values: Array, rounding: float = ROUNDING) -> BoolArray:
    """Whether increasing eigenvalues, (..., k), are more than rounding of the largest, (..., k)."""
    return np.asarray(values > rounding * np.maximum(values[..., -1:], _SMALLEST_DIVISOR))


def least_norm(rows: Array, right: Array) -> Array:
    """Least-squares solution of `rows @ x = right` of least norm, (m, k) and (m,) to (k,)."""
    return np.asarray(np.linalg.lstsq(rows, right, rcond=INDEPENDENT_SHARE)[0], dtype=np.float64)


@dataclass(frozen=True, eq=False)
class NullVector:
    """Unit vector, (k,), that rows map nearest to zero, and whether it is unique."""

    vector: Array
    unique: bool


def smallest_vectors(matrix: Array) -> Array:
    """Eigenvectors of the smallest eigenvalues of symmetric positive semidefinite matrices (..., k, k), (..., k).

    Computed by inverse iteration with repeated squaring, in half the time of a decomposition for many matrices. If the
    smallest eigenvalue is a share r of the next, a part r^16 of the next eigenvector remains. For two equal smallest
    eigenvalues, the result is any vector of their eigenspace.
    """
    inverse = matrix.copy()
    diagonal = np.einsum("...ii->...i", inverse)  # a view
    diagonal += np.maximum(_RIDGE * diagonal.sum(-1, keepdims=True), _SMALLEST_RIDGE)
    inverse = np.asarray(np.linalg.inv(inverse), dtype=np.float64)
    for _ in range(_SQUARINGS):
        inverse /= np.einsum("...ii->...", inverse)[..., None, None]
        inverse = inverse @ inverse
    largest = np.argmax(np.einsum("...ii->...i", inverse), axis=-1)
    column = np.take_along_axis(inverse, largest[..., None, None], axis=-1)[..., 0]
    return np.asarray(column / lengths(column)[..., None])


def null_vector(squares: Array, size: float) -> NullVector:
    """Null vector of noisy rows; unique if the next singular value is well above its own and above zero.

    Args:
        squares: (k, k) products of the rows, `rows.T @ rows`.
        size: Root of the sum of squared sizes of the rows' blocks, the scale of singular values.
    """
    # LAPACK directly: the input checks of SciPy's eigh take a quarter longer.
    values, vectors, *_ = dsyevr(squares, range="I", il=1, iu=2)
    first, second = np.sqrt(np.maximum(values[:2], 0.0)) / size
    return NullVector(vectors[:, 0], bool(first < NULL_GAP * second and second > _SECOND_NULL_SHARE))


@dataclass(frozen=True, eq=False)
class RotatedBasis:
    """Rotated basis (p, k), with columns sorted by the norm of their part in some rows, and this norm, (k,)."""

    basis: Array
    share: Array


def sort_by_share(basis: Array, rows: IntArray) -> RotatedBasis:
    """Rotate a basis, (p, k), so that its columns are orthogonal in some rows, sorted by their norm there."""
    if not len(rows) or not basis.shape[1]:
        return RotatedBasis(basis, np.zeros(basis.shape[1]))
    _, values, mix = np.linalg.svd(basis[rows], full_matrices=len(rows) < basis.shape[1])
    return RotatedBasis(basis @ mix.T, np.pad(values, (0, basis.shape[1] - len(values))))


@dataclass(frozen=True, eq=False)
class PrincipalAxes:
    """Principal axes of vectors: unit axes as columns, (k, k), decreasing extents (k,), and their number above zero."""

    axes: Array
    extents: Array
    dimension: int


def principal_axes(vectors: Array, least: float = FLAT_SHARE) -> PrincipalAxes:
    """Principal axes of vectors (n, k) about the origin; extents up to `least` times the largest count as zero."""
    _, values, axes = np.linalg.svd(vectors, full_matrices=vectors.shape[0] < vectors.shape[1])
    extents = np.append(values, np.zeros(vectors.shape[1] - len(values)))
    return PrincipalAxes(
        axes.T, extents, int(np.count_nonzero(extents > least * np.max(extents, initial=_SMALLEST_DIVISOR)))
    )


def pseudo_inverse(rows: Array) -> Array:
    """Moore-Penrose inverse of rows (m, k) that are exact except for rounding, (k, m)."""
    return np.asarray(np.linalg.pinv(rows, rcond=INDEPENDENT_SHARE), dtype=np.float64)


def dimension(points: Array, least: float = FLAT_SHARE) -> int:
    """Number of dimensions that points (p, 3) span: 0 if all are equal, 1 on a line, 2 in a plane, else 3."""
    return principal_axes(points - points.mean(0), least).dimension if len(points) else 0
