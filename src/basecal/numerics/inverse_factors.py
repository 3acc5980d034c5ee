"""Inverses of the Cholesky factors of many small matrices, vectorised.

LAPACK is called for one matrix at a time, and for small matrices the call costs more than the computation. Here each
step of the factorisation is done for all matrices together, with the matrices along the last axis.
"""

from __future__ import annotations

from math import prod
from typing import NamedTuple

import numpy as np

from basecal.geometry import Array

_FEW_MATRICES = 64  # for fewer matrices LAPACK is faster
_CHUNK_NUMBERS = 2**17  # numbers per chunk: a megabyte fits the cache


class InverseFactors(NamedTuple):
    """Lower triangular factors R, (..., q, q), with R'R the inverse of M, and log det M, (...,)."""

    root: Array
    log_det: Array


def inverse_factors(matrices: Array) -> InverseFactors:
    """Inverse factors of symmetric positive definite matrices, (..., q, q); a non-finite one does not affect others.

    Raises:
        LinAlgError: if a matrix is not positive definite, and all matrices are finite.
    """
    *batch, q, _ = matrices.shape
    flat = matrices.reshape(prod(batch), q, q)
    if len(flat) < _FEW_MATRICES:
        factor = np.linalg.cholesky(matrices)
        log_det = 2 * np.log(np.diagonal(factor, axis1=-2, axis2=-1)).sum(-1)
        return InverseFactors(np.asarray(np.linalg.inv(factor), dtype=np.float64), log_det)
    root, log_det = np.empty(flat.shape), np.empty(len(flat))
    size = max(1, _CHUNK_NUMBERS // max(1, q * q))
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        for first in range(0, len(flat), size):
            chunk = slice(first, first + size)
            inverse, log_det[chunk] = _invert_factors(flat[chunk].transpose(1, 2, 0).copy())
            root[chunk] = inverse.transpose(2, 0, 1)
    if not np.isfinite(log_det).all() and np.isfinite(matrices).all():
        raise np.linalg.LinAlgError("a matrix is not positive definite")
    return InverseFactors(root.reshape(matrices.shape), log_det.reshape(batch))


def _invert_factors(lower: Array) -> tuple[Array, Array]:
    """Inverses of the Cholesky factors of matrices (q, q, b), and log determinants, (b,).

    The factors overwrite the input.
    """
    inverse, log_det = np.zeros_like(lower), np.zeros(lower.shape[-1])
    for j in range(len(lower)):
        above = lower[j, :j]
        lower[j:, j] -= np.einsum("ikb,kb->ib", lower[j:, :j], above)
        pivot = lower[j, j]
        log_det += np.log(pivot)
        reciprocal = 1 / np.sqrt(pivot)
        lower[j:, j] *= reciprocal
        inverse[j, :j] = -reciprocal * np.einsum("kb,kcb->cb", above, inverse[:j, :j])
        inverse[j, j] = reciprocal
    return inverse, log_det
