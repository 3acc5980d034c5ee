"""How exponential and logarithm of SE(3) answer to small steps on the right.

Source: Barfoot 2017, "State Estimation for Robotics"; Sola et al. 2018, arXiv:1812.01537.
"""

from __future__ import annotations

import numpy as np

from basecal.geometry.array import Array
from basecal.geometry.rotation import even_coefficient, exp_coefficients, hat


def _q_matrix(v: Array, w: Array) -> Array:
    """The coupling block of the right Jacobian of SE(3). Source: Barfoot 2017, eq. (7.86), at -xi."""
    angle = np.linalg.norm(w, axis=-1)
    c3 = even_coefficient(angle, 3, lambda x: (x - np.sin(x)) / x**3)
    c4 = even_coefficient(angle, 4, lambda x: (x**2 / 2 + np.cos(x) - 1) / x**4)
    c5 = even_coefficient(angle, 5, lambda x: (x**3 / 6 - x + np.sin(x)) / x**5)
    p, f = hat(-v), hat(-w)
    fp, pf = f @ p, p @ f
    fpf = fp @ f
    first = 0.5 * p + c3[..., None, None] * (fp + pf + fpf)
    second = c4[..., None, None] * (f @ fp + pf @ f - 3 * fpf)
    third = 0.5 * (c4 - 3 * c5)[..., None, None] * (fpf @ f + f @ fpf)
    block: Array = first + second + third
    return block


def right_jacobian(xi: Array) -> Array:
    """The derivative d log(exp(xi)^-1 exp(xi + d)) / dd at 0, (..., 6) to (..., 6, 6)."""
    v, w = xi[..., :3], xi[..., 3:]
    _, b, c = exp_coefficients(np.linalg.norm(w, axis=-1))
    k = hat(w)
    jr = np.eye(3) - b[..., None, None] * k + c[..., None, None] * (k @ k)
    out = np.zeros((*xi.shape[:-1], 6, 6))
    out[..., :3, :3] = out[..., 3:, 3:] = jr
    out[..., :3, 3:] = _q_matrix(v, w)
    return out


def right_jacobian_inverse(xi: Array) -> Array:
    """The derivative d log(exp(xi) exp(d)) / dd at 0, (..., 6) to (..., 6, 6); rotation angle below 2 pi."""
    return np.asarray(np.linalg.inv(right_jacobian(xi)), dtype=np.float64)
