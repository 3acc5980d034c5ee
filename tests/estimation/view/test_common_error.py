"""Tests of an error shared by all points of a view."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.estimation.view.common_error import without_common_shift, without_motion


@pytest.mark.parametrize("tau", [1e-3, 0.5, 1e3])
def test_shared_shift_equals_the_full_covariance(rng, tau):
    """Cost, gradient and information are r'V^-1 r, J'V^-1 r and J'V^-1 J with V = diag(sigma^2) + tau^2 11'."""
    n, p, k = 3, 7, 6
    weight, off, jacobian = rng.uniform(0.5, 3.0, (n, p)), rng.normal(size=(n, 2, p)), rng.normal(size=(n, k, 2, p))
    residual, whitened = off * weight[:, None], jacobian * weight[:, None, None]
    view = (
        np.einsum("nip,nip->n", residual, residual),
        np.einsum("nkip,nip->nk", whitened, residual),
        np.einsum("nkip,nlip->nkl", whitened, whitened),
    )
    by_shift = np.einsum("nkip,np->nki", whitened, weight)
    cost, gradient, information = without_common_shift(view, residual, weight, by_shift, tau)
    inverse = np.linalg.inv(np.stack([np.diag(w**-2.0) for w in weight]) + tau**2 * np.ones((p, p)))
    np.testing.assert_allclose(cost, np.einsum("nip,npq,niq->n", off, inverse, off), rtol=1e-7)
    np.testing.assert_allclose(gradient, np.einsum("nkip,npq,niq->nk", jacobian, inverse, off), rtol=1e-6, atol=1e-8)
    expected = np.einsum("nkip,npq,nliq->nkl", jacobian, inverse, jacobian)
    np.testing.assert_allclose(information, expected, rtol=1e-6, atol=1e-8)


def test_shared_motion_is_marginalised():
    """The result equals a residual covariance with one more column, as for whitened residuals."""
    rng = np.random.default_rng(3)
    jacobian, residual, motion = (
        rng.standard_normal((4, 12, 8)),
        rng.standard_normal((4, 12)),
        rng.standard_normal((4, 6)),
    )
    by_motion = (jacobian[..., :6] @ motion[..., None])[..., 0]
    inverse = np.linalg.inv(np.eye(12) + by_motion[:, :, None] * by_motion[:, None, :])
    cost = np.einsum("ni,ni->n", residual, residual)
    gradient, information = (
        (np.swapaxes(jacobian, 1, 2) @ residual[..., None])[..., 0],
        np.swapaxes(jacobian, 1, 2) @ jacobian,
    )
    found = without_motion(cost, gradient, information, motion)
    whole = np.concatenate([jacobian, residual[..., None]], -1)
    expected = np.swapaxes(whole, 1, 2) @ inverse @ whole
    np.testing.assert_allclose(found[2], expected[:, :8, :8], atol=1e-10)
    np.testing.assert_allclose(found[1], expected[:, :8, 8], atol=1e-10)
    np.testing.assert_allclose(found[0], expected[:, 8, 8], atol=1e-10)
