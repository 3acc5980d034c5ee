"""Right Jacobians of the exponential and logarithm of SE(3).

Source: Barfoot 2017, "State Estimation for Robotics"; Sola et al. 2018, arXiv:1812.01537.
"""

from __future__ import annotations

import numpy as np

from basecal.geometry.array import Array
from basecal.geometry.rotation import cross_matrix, exp_coefficients, lengths, with_identity


def right_jacobian(xi: Array) -> Array:
    """Right Jacobian d log(exp(xi)^-1 exp(xi + d)) / dd at d = 0, (..., 6) to (..., 6, 6).

    This is Barfoot's (7.86) at -xi, with expanded products of the cross-product matrices hat(a) and hat(b). They are
    hat(a) hat(b) = b a' - a'b I and hat(a) hat(b) hat(a) = -a'b hat(a).
    """
    v, w = xi[..., :3], xi[..., 3:]
    angle = lengths(w)
    _, c2, c3, c4, c5 = exp_coefficients(angle, 5)
    square, dot = angle * angle, np.einsum("...i,...i->...", v, w)
    outer, mixed = w[..., :, None] * w[..., None, :], v[..., :, None] * w[..., None, :]
    diagonal_block = c3[..., None, None] * outer - cross_matrix(c2[..., None] * w)
    coefficient = dot * (c4 - 3 * c5)
    off_diagonal_block = c3[..., None, None] * (mixed + mixed.mT) - coefficient[..., None, None] * outer
    off_diagonal_block -= cross_matrix((0.5 - c4 * square)[..., None] * v + ((2 * c4 - c3) * dot)[..., None] * w)
    out = np.zeros((*xi.shape[:-1], 6, 6))
    out[..., :3, :3] = out[..., 3:, 3:] = with_identity(diagonal_block, 1 - c3 * square)
    out[..., :3, 3:] = with_identity(off_diagonal_block, coefficient * square - 2 * c3 * dot)
    return out


def right_jacobian_inverse(xi: Array) -> Array:
    """Inverse right Jacobian d log(exp(xi) exp(d)) / dd at d = 0, (..., 6) to (..., 6, 6); angles below 2 pi."""
    return np.asarray(np.linalg.inv(right_jacobian(xi)), dtype=np.float64)
