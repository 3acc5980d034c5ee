"""Rank, null space and pseudo-inverse: what of a matrix is information and what is rounding.

Information matrices are scaled to a unit diagonal first, since they combine metres, radians and pixels of a lens.
Eigenvalues then compare the information about combinations with that about the unknowns themselves. Matrices whose
units say what counts (shares of a variance, motions in radians) are not scaled, see `scaled_spectrum`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.linalg.lapack import dsyevr

from basecal.geometry import Array, BoolArray, IntArray
from basecal.geometry.rotation import lengths

ROUNDING = 1e-12  # eigenvalue over the largest, of information: J'J loses 1e-16 of it per row, some thousands of them
# Likewise of one view: moments about an origin twenty targets away round at 2e-13, what two points hold is above 1e-6.
VIEW_ROUNDING = 1e-9
INDEPENDENT_SHARE = (
    1e-9  # singular value over the largest, of columns that are exact but for rounding of 1e-16 a product
)
FLAT_SHARE = 1e-6  # extent over the largest: a micrometre on a metre is no depth, and ten orders above rounding
NULL_GAP = 0.35  # singular value of a null vector over the next: noise leaves less, two null vectors are alike
_SECOND_NULL_SHARE = 1e-3  # next singular value of rows of unit size: below, noise apart, more than one vector is null
_SMALLEST_DIVISOR = 1e-300  # keeps quotients of zeros finite
_RIDGE, _SMALLEST_RIDGE = 1e-15, 1e-100  # of the trace, and of none: makes a singular matrix invertible
_SQUARINGS = 4


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
        return np.asarray(self.inverse_root @ self.inverse_root.mT)

    def inverse_with_ridge(self, ridge: float) -> Array:
        """`(M + ridge)^-1`, (..., k, k), among the directions that hold information; zero along the others.

        Regular whatever the sizes of ridge and matrix: `Q (1 + ridge Q' Q)^-1 Q'`, of the eigenvalues of `ridge Q' Q`.
        """
        root = self.inverse_root
        if not root.size:
            return root
        values, vectors = np.linalg.eigh(ridge * (root.mT @ root))
        along = root @ vectors
        return np.asarray((along / (1 + np.maximum(values, 0.0))[..., None, :]) @ along.mT)

    @property
    def log_det(self) -> Array:
        """(...,) logarithm of the determinant over what holds information."""
        logs = np.log(np.where(self.held, self.values, 1.0)).sum(-1)
        return np.asarray(logs + 2 * np.log(self.scale).sum(-1))

    def add_ridge(self, share: float) -> Spectrum:
        """A copy with so small a share of the largest eigenvalue added to each: small information fades out.

        If eigenvalues are near a limit, the directions that it admits change abruptly from one matrix to its neighbour.
        The quotients of these eigenvalues and the new ones are the weights of the directions, and change as smoothly as
        the eigenvalues.
        """
        values = np.maximum(self.values, 0.0)
        raised = values + share * np.maximum(values[..., -1:], _SMALLEST_DIVISOR)
        return replace(self, values=raised, held=np.ones(self.held.shape, dtype=bool))

    def squared_mahalanobis(self, vector: Array) -> Array:
        """`v' M^+ v` of vectors (..., k), (...,)."""
        along = (self.vectors.mT @ (vector / self.scale)[..., None])[..., 0]
        return np.asarray(np.sum(np.where(self.held, along**2 / np.where(self.held, self.values, 1.0), 0.0), -1))


def spectrum(information: Array, rounding: float = ROUNDING) -> Spectrum:
    """Information matrices (..., k, k) taken apart, scaled to a unit diagonal.

    Args:
        information: Symmetric, positive semidefinite but for rounding.
        rounding: Share of the largest eigenvalue up to which one is none.
    """
    diagonal = np.sqrt(np.maximum(np.diagonal(information, axis1=-2, axis2=-1), 0.0))
    scale = np.where(diagonal > 0, diagonal, 1.0)
    if not information.size:
        return Spectrum(diagonal, np.zeros(information.shape), scale, np.zeros(diagonal.shape, dtype=bool))
    values, vectors = np.linalg.eigh(information / scale[..., :, None] / scale[..., None, :])
    return Spectrum(values, vectors, scale, holds_information(values, rounding))


def scaled_spectrum(matrix: Array, least: float | Array, scale: Array | None = None) -> Spectrum:
    """Symmetric matrices (..., k, k) taken apart in units in which `least` is the smallest eigenvalue that counts.

    None counts that is rounding of the largest.

    Args:
        matrix: Symmetric, positive semidefinite but for rounding.
        least: In units of the matrix, over the squares of `scale`.
        scale: (..., k) what one unit of each row and column is; 1 where None.
    """
    scaled = matrix if scale is None else matrix / scale[..., :, None] / scale[..., None, :]
    scale = np.ones(matrix.shape[:-1]) if scale is None else scale
    if not matrix.size:
        return Spectrum(scale, matrix, scale, np.zeros(scale.shape, dtype=bool))
    values, vectors = np.linalg.eigh(scaled)
    return Spectrum(values, vectors, scale, (values > least) & holds_information(values))


def floored_spectrum(matrix: Array, least: float | Array) -> Spectrum:
    """Symmetric matrices (..., k, k) with eigenvalues below `least` raised to it: regular, for steps and densities."""
    of = scaled_spectrum(matrix, least)
    return replace(of, values=np.maximum(of.values, least), held=np.ones(of.held.shape, dtype=bool))


def floored_inverse(matrix: Array, least: float) -> Array:
    """The inverse of what `floored_spectrum` gives; decomposes only if an eigenvalue is below the floor.

    The floor is `least`, or rounding of the trace if that is more: an inverse of less has negative variances.
    """
    floor = np.maximum(least, ROUNDING * np.trace(matrix, axis1=-2, axis2=-1))[..., None]
    try:
        np.linalg.cholesky(matrix - floor[..., None] * np.eye(matrix.shape[-1]))
    except np.linalg.LinAlgError:
        return floored_spectrum(matrix, floor).inverse
    return np.asarray(np.linalg.inv(matrix), dtype=np.float64)


def inverse_beside_identity(matrix: Array) -> Array:
    """`(1 + M)^-1` of symmetric, positive semidefinite M, (..., k, k): regular if M drowns the identity in rounding."""
    values, vectors = np.linalg.eigh(matrix)
    return np.asarray((vectors / (1 + np.maximum(values, 0.0))[..., None, :]) @ vectors.mT)


def holds_information(values: Array, rounding: float = ROUNDING) -> BoolArray:
    """Which eigenvalues, (..., k) rising, are more than rounding of the largest."""
    return np.asarray(values > rounding * np.maximum(values[..., -1:], _SMALLEST_DIVISOR))


def least_norm(rows: Array, right: Array) -> Array:
    """The smallest of the least-squares solutions of `rows @ x = right`, (m, k) and (m,) to (k,)."""
    return np.asarray(np.linalg.lstsq(rows, right, rcond=INDEPENDENT_SHARE)[0], dtype=np.float64)


@dataclass(frozen=True, eq=False)
class NullVector:
    """The unit vector, (k,), that rows map nearest to zero, and whether it alone."""

    vector: Array
    unique: bool


def smallest_vectors(matrix: Array) -> Array:
    """The eigenvectors of the smallest eigenvalues of symmetric positive semidefinite matrices (..., k, k), (..., k).

    By inverse iteration, squared, in half the time of the decomposition of many. If the smallest eigenvalue is a share
    r of the next, r^16 of the next vector is left. Two equal ones give some vector of both.
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
    """The null vector of noisy rows, unique where the next singular value stands clear of its own and of nothing.

    Args:
        squares: (k, k) the rows' products, `rows.T @ rows`.
        size: Root of the sum of squared sizes of the rows' blocks, which singular values are compared with.
    """
    # By LAPACK itself: SciPy's eigh takes a quarter longer to check what it is given.
    values, vectors, *_ = dsyevr(squares, range="I", il=1, iu=2)
    first, second = np.sqrt(np.maximum(values[:2], 0.0)) / size
    return NullVector(vectors[:, 0], bool(first < NULL_GAP * second and second > _SECOND_NULL_SHARE))


@dataclass(frozen=True, eq=False)
class Turned:
    """A basis (p, k) turned so that its columns fall by how much of them lies in some rows, that share (k,) beside."""

    basis: Array
    share: Array


def sort_by_share(basis: Array, rows: IntArray) -> Turned:
    """A basis, (p, k), turned by what its directions move of some rows, orthogonal there."""
    if not len(rows) or not basis.shape[1]:
        return Turned(basis, np.zeros(basis.shape[1]))
    _, values, mix = np.linalg.svd(basis[rows], full_matrices=len(rows) < basis.shape[1])
    return Turned(basis @ mix.T, np.pad(values, (0, basis.shape[1] - len(values))))


@dataclass(frozen=True, eq=False)
class PrincipalAxes:
    """How vectors spread: along unit axes, one a column of (k, k), by extents (k,), falling; counted to `dimension`."""

    axes: Array
    extents: Array
    dimension: int


def principal_axes(vectors: Array, least: float = FLAT_SHARE) -> PrincipalAxes:
    """Axes along which vectors (n, k) from the origin spread; extents up to `least` of the largest are none."""
    _, values, axes = np.linalg.svd(vectors, full_matrices=vectors.shape[0] < vectors.shape[1])
    extents = np.append(values, np.zeros(vectors.shape[1] - len(values)))
    return PrincipalAxes(
        axes.T, extents, int(np.count_nonzero(extents > least * np.max(extents, initial=_SMALLEST_DIVISOR)))
    )


def pseudo_inverse(rows: Array) -> Array:
    """Moore and Penrose's inverse of rows (m, k) that are exact but for rounding, (k, m)."""
    return np.asarray(np.linalg.pinv(rows, rcond=INDEPENDENT_SHARE), dtype=np.float64)


def dimension(points: Array, least: float = FLAT_SHARE) -> int:
    """How many dimensions points (p, 3) span: 0 if all are one, 1 on a line, 2 in a plane, else 3."""
    return principal_axes(points - points.mean(0), least).dimension if len(points) else 0
