"""Sparse Hessians of problems with many unknowns: factorisation, extreme eigenvalues, and parts of the inverse."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy  # submodules are loaded when they are first used

from basecal.geometry import Array, IntArray
from basecal.numerics.spectral import ROUNDING

_LEAST_DIAGONAL = 1e-12  # relative to the largest entry: limits the scale of columns without information
_EIGENVALUE_TOLERANCE = 1e-3  # relative tolerance of eigenvalues, which are compared with limits of one digit
_CHUNK_COLUMNS = 512  # right-hand sides per solve: some tens of megabytes for ten thousand unknowns


@dataclass(frozen=True, eq=False)
class SparseHessian:
    """A symmetric, positive semidefinite matrix (p, p), mostly zeros."""

    matrix: scipy.sparse.csc_array

    def quadratic(self, step: Array) -> Array:
        """Quadratic form `step' H step` for a step (1, p), (1,)."""
        return np.array([step[0] @ (self.matrix @ step[0])])

    def damped_step(self, gradient: Array, damping: Array) -> Array:
        """Damped Newton step, (1, p), for a gradient (1, p) and a damping (1,) of the scaled diagonal.

        Raises:
            LinAlgError: if the damped matrix is singular.
        """
        if not np.isfinite(self.matrix.data).all():  # NaN without an error, as in NumPy
            return np.full_like(gradient, np.nan)
        factor = _factorise(
            self._scaled_matrix + float(damping[0]) * scipy.sparse.diags_array(np.ones(len(self._scale)), format="csc")
        )
        step = -self._scale * factor.solve(self._scale * gradient[0])
        return np.asarray(step[None])

    @cached_property
    def _scale(self) -> Array:
        diagonal = self.matrix.diagonal()
        return np.asarray(1 / np.sqrt(np.maximum(diagonal, _LEAST_DIAGONAL * diagonal.max(initial=1e-300))))

    @cached_property
    def _scaled_matrix(self) -> scipy.sparse.csc_array:
        scaling = scipy.sparse.diags_array(self._scale, format="csc")
        return scipy.sparse.csc_array(scaling @ self.matrix @ scaling)

    @cached_property
    def factor(self) -> scipy.sparse.linalg.SuperLU:
        """LU factor of the scaled matrix.

        Raises:
            LinAlgError: if the matrix is singular.
        """
        return _factorise(self._scaled_matrix)

    @cached_property
    def extremes(self) -> tuple[float, float]:
        """Smallest and largest eigenvalue; the smallest is 0 if it is within rounding of the largest."""
        largest = _largest_eigenvalue(len(self._scale), lambda x: self.matrix @ x)
        try:
            smallest = 1 / _largest_eigenvalue(
                len(self._scale), lambda x: self._scale * self.factor.solve(self._scale * x)
            )
        except np.linalg.LinAlgError:
            return 0.0, largest
        return (smallest if smallest > ROUNDING * largest else 0.0), largest

    def rescale(self, scale: Array) -> SparseHessian:
        """Return the Hessian in new units of the unknowns, with `scale` (p,) old units per new unit."""
        scaling = scipy.sparse.diags_array(scale, format="csc")
        return SparseHessian(scipy.sparse.csc_array(scaling @ self.matrix @ scaling))

    def inverse_columns(self, columns: IntArray) -> Array:
        """Columns of the inverse, (p, c)."""
        inverse = np.empty((len(self._scale), len(columns)))
        for first in range(0, len(columns), _CHUNK_COLUMNS):
            chunk = columns[first : first + _CHUNK_COLUMNS]
            right = np.zeros((len(self._scale), len(chunk)))
            right[chunk, np.arange(len(chunk))] = self._scale[chunk]
            inverse[:, first : first + len(chunk)] = self._scale[:, None] * self.factor.solve(right)
        return inverse

    def inverse_block(self, columns: IntArray) -> Array:
        """Symmetric block of the inverse at rows and columns (c,), (c, c)."""
        block = np.empty((len(columns), len(columns)))
        for first in range(0, len(columns), _CHUNK_COLUMNS):
            chunk = columns[first : first + _CHUNK_COLUMNS]
            block[:, first : first + len(chunk)] = self.inverse_columns(chunk)[columns]
        return 0.5 * (block + block.T)


def _factorise(matrix: scipy.sparse.csc_array) -> scipy.sparse.linalg.SuperLU:
    try:
        return scipy.sparse.linalg.splu(
            scipy.sparse.csc_array(matrix),
            permc_spec="MMD_AT_PLUS_A",
            options={"SymmetricMode": True},
            diag_pivot_thresh=0.0,
        )
    except RuntimeError as error:  # SciPy's error for a singular matrix
        raise np.linalg.LinAlgError("the unknowns have no solution") from error


def _largest_eigenvalue(size: int, apply: Callable[[Array], Array]) -> float:
    """Largest eigenvalue of a symmetric operator."""
    operator = scipy.sparse.linalg.LinearOperator((size, size), matvec=apply, dtype=np.float64)
    start = np.random.default_rng(0).standard_normal(size)  # the same in every run
    return float(
        scipy.sparse.linalg.eigsh(
            operator, k=1, which="LA", v0=start, tol=_EIGENVALUE_TOLERANCE, return_eigenvectors=False
        )[0]
    )
