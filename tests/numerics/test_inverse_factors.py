"""Inverses of Cholesky factors."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.numerics.inverse_factors import inverse_factors


@pytest.mark.parametrize("shape", [(3,), (70,), (4, 40), (1200,), (0,)])
def test_factors_invert_and_measure_the_matrices(shape):
    """Few or many, in chunks, with axes before: R M R' is the identity, R is lower triangular, log det as NumPy's."""
    rng = np.random.default_rng(len(shape))
    rows = rng.standard_normal((*shape, 12, 20)) * np.logspace(-2, 2, 12)[:, None]
    matrices = rows @ rows.mT
    root, log_det = inverse_factors(matrices)
    np.testing.assert_allclose(root @ matrices @ root.mT, np.broadcast_to(np.eye(12), matrices.shape), atol=1e-9)
    np.testing.assert_allclose(root, np.tril(root), atol=1e-12 * np.abs(root).max(initial=0.0))
    np.testing.assert_allclose(log_det, np.linalg.slogdet(matrices)[1], rtol=1e-12)


@pytest.mark.parametrize("count", [3, 70])
@pytest.mark.parametrize("wrong", [np.diag([1.0, -1.0]), -np.eye(2), np.ones((2, 2)) - 1e-3 * np.eye(2)])
def test_what_has_no_factor_is_refused(count, wrong):
    """One among many, of a negative eigenvalue."""
    matrices = np.tile(np.eye(2), (count, 1, 1))
    matrices[1] = wrong
    with pytest.raises(np.linalg.LinAlgError):
        inverse_factors(matrices)


@pytest.mark.parametrize("count", [3, 70])
def test_what_is_no_number_stays_with_its_matrix(count):
    """The others have their factors."""
    matrices = np.tile(np.diag([4.0, 9.0]), (count, 1, 1))
    matrices[1] = np.nan
    root, log_det = inverse_factors(matrices)
    assert np.isnan(log_det[1])
    np.testing.assert_allclose(np.delete(root, 1, axis=0), np.tile(np.diag([1 / 2, 1 / 3]), (count - 1, 1, 1)))
