"""Tests of inverses of Cholesky factors."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.numerics import inverse_factors as module
from basecal.numerics.inverse_factors import _invert_factors, inverse_factors


@pytest.mark.parametrize("shape", [(3,), (2, 5), (70,), (4, 40), (1200,), (0,)])
def test_inverse_factors_and_log_determinants(shape):
    """R M R' is the identity, R is lower triangular, and log det is NumPy's.

    The batches are few and many matrices, in chunks, and with leading axes.
    """
    rng = np.random.default_rng(len(shape))
    rows = rng.standard_normal((*shape, 12, 20)) * np.logspace(-2, 2, 12)[:, None]
    matrices = rows @ rows.mT
    root, log_det = inverse_factors(matrices)
    np.testing.assert_allclose(root @ matrices @ root.mT, np.broadcast_to(np.eye(12), matrices.shape), atol=1e-9)
    np.testing.assert_allclose(root, np.tril(root), atol=1e-12 * np.abs(root).max(initial=0.0))
    np.testing.assert_allclose(log_det, np.linalg.slogdet(matrices)[1], rtol=1e-12)


@pytest.mark.parametrize("count", [3, 70])
@pytest.mark.parametrize("wrong", [np.diag([1.0, -1.0]), -np.eye(2), np.ones((2, 2)) - 1e-3 * np.eye(2)])
def test_indefinite_matrix_is_refused(count, wrong):
    """One matrix with a negative eigenvalue among many raises LinAlgError."""
    matrices = np.tile(np.eye(2), (count, 1, 1))
    matrices[1] = wrong
    with pytest.raises(np.linalg.LinAlgError):
        inverse_factors(matrices)


@pytest.mark.parametrize("count", [3, 70])
def test_non_finite_matrix_leaves_other_factors_valid(count):
    """A matrix of NaN has a log determinant of NaN, and the other matrices have their factors."""
    matrices = np.tile(np.diag([4.0, 9.0]), (count, 1, 1))
    matrices[1] = np.nan
    root, log_det = inverse_factors(matrices)
    assert np.isnan(log_det[1])
    np.testing.assert_allclose(np.delete(root, 1, axis=0), np.tile(np.diag([1 / 2, 1 / 3]), (count - 1, 1, 1)))


@pytest.mark.parametrize(("count", "at_once", "chunks"), [
    (63, 2**17, []),  # by LAPACK, one by one
    (64, 2**17, [64]),
    (1200, 2**17, [910, 290]),
    (70, 40 * 144 + 143, [40, 30]),
    (64, 100, [1] * 64),  # one at a time if even one exceeds the limit
])  # fmt: skip
def test_large_batches_are_factorised_in_chunks(monkeypatch, count, at_once, chunks):
    """A chunk has as many matrices as fit into a limit of numbers; small batches are factorised one by one."""
    taken = []

    def factorised(lower):
        """`_invert_factors`, with its batch size recorded."""
        taken.append(lower.shape[-1])
        return _invert_factors(lower)

    assert module._CHUNK_NUMBERS == 2**17
    monkeypatch.setattr(module, "_CHUNK_NUMBERS", at_once)
    monkeypatch.setattr(module, "_invert_factors", factorised)
    matrices = np.tile(4 * np.eye(12), (count, 1, 1))
    root, log_det = inverse_factors(matrices)
    assert taken == chunks
    np.testing.assert_allclose(root, np.tile(0.5 * np.eye(12), (count, 1, 1)))
    np.testing.assert_allclose(log_det, np.full(count, 12 * np.log(4)))


def test_empty_matrices_have_empty_factors():
    """Matrices of size 0 have factors of size 0, for batches of any length."""
    for count in (3, 70):
        root, log_det = inverse_factors(np.zeros((count, 0, 0)))
        assert root.shape == (count, 0, 0)
        np.testing.assert_array_equal(log_det, np.zeros(count))
