"""Rotation matrices, batched over leading axes: their exponential, logarithm and quaternions.

Below 0.5 rad every coefficient is a series, since the closed forms cancel.
"""

from __future__ import annotations

from collections.abc import Callable
from math import factorial

import numpy as np

from basecal.errors import InputError
from basecal.geometry.array import Array

_SERIES_BELOW = 0.5
_RECIPROCALS = np.array([[(-1) ** k / factorial(2 * k + first) for first in range(1, 6)] for k in range(9)])
ROTATION_TOLERANCE = 1e-3


def hat(w: Array) -> Array:
    """The cross-product matrix, (..., 3) to (..., 3, 3): `hat(w) @ v == cross(w, v)`."""
    out = np.zeros((*w.shape, 3))
    out[..., 0, 1], out[..., 0, 2], out[..., 1, 2] = -w[..., 2], w[..., 1], -w[..., 0]
    out[..., 1, 0], out[..., 2, 0], out[..., 2, 1] = w[..., 2], -w[..., 1], w[..., 0]
    return out


def _series(x2: Array, coefficients: Array) -> Array:
    """Sum of c_k x2^k, Horner's way; several series at once where the coefficients have a last axis, as x2 then has."""
    total: Array = coefficients[-1] * x2
    for coefficient in coefficients[-2:0:-1]:
        total += coefficient
        total *= x2
    total += coefficients[0]
    return total


def even_coefficient(angle: Array, first_factorial: int, closed: Callable[[Array], Array]) -> Array:
    """A coefficient that is even in the angle: its series below 0.5 rad, its closed form above."""
    small = angle < _SERIES_BELOW
    near = _series(np.where(small, angle * angle, 0.0), _RECIPROCALS[:, first_factorial - 1])
    value: Array = np.where(small, near, closed(np.where(small, 1.0, angle)))
    return value


def exp_coefficients(angle: Array) -> tuple[Array, Array, Array]:
    """The values sin x / x, (1 - cos x) / x^2 and (x - sin x) / x^3, exact at and near zero."""
    if np.all(angle < _SERIES_BELOW):
        together = _series((angle * angle)[..., None], _RECIPROCALS[:, :3])
        return together[..., 0], together[..., 1], together[..., 2]
    return (
        even_coefficient(angle, 1, lambda x: np.sin(x) / x),
        even_coefficient(angle, 2, lambda x: (1 - np.cos(x)) / x**2),
        even_coefficient(angle, 3, lambda x: (x - np.sin(x)) / x**3),
    )


def rotation_exp(w: Array) -> Array:
    """Rotation matrices of rotation vectors, (..., 3) [rad] to (..., 3, 3)."""
    a, b, _ = exp_coefficients(np.linalg.norm(w, axis=-1))
    k = hat(w)
    return np.eye(3) + a[..., None, None] * k + b[..., None, None] * (k @ k)


def rotation_log(rotation: Array) -> Array:
    """Rotation vectors of rotation matrices, (..., 3, 3) to (..., 3) [rad], angle in [0, pi].

    By the quaternion, which is well conditioned at every angle.
    """
    q = quaternion_from_rotation(rotation)
    v, w = q[..., :3], q[..., 3]
    norm = np.linalg.norm(v, axis=-1)
    safe = np.where(norm > 0, norm, 1.0)
    # atan2(n, w) / n tends to 1 / w where n tends to zero; w >= 0 by construction.
    scale = np.where(norm > 0, 2 * np.arctan2(norm, w) / safe, 2.0)
    return v * scale[..., None]


def quaternion_from_rotation(rotation: Array) -> Array:
    """Unit quaternions (x, y, z, w) with w >= 0 of rotation matrices, (..., 3, 3) to (..., 4).

    Source: Bar-Itzhack 2000 written out: the largest of four exact expressions is divided by.
    """
    r = rotation
    d = np.stack([r[..., 0, 0], r[..., 1, 1], r[..., 2, 2]], -1)
    trace = d.sum(-1)
    q = np.empty((*r.shape[:-2], 4, 4))
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        q[..., i, i] = 1 + d[..., i] - d[..., j] - d[..., k]
        q[..., i, j] = q[..., j, i] = r[..., i, j] + r[..., j, i]
        q[..., i, 3] = q[..., 3, i] = r[..., k, j] - r[..., j, k]
    q[..., 3, 3] = 1 + trace
    best = np.argmax(np.diagonal(q, axis1=-2, axis2=-1), axis=-1)
    out = np.take_along_axis(q, best[..., None, None], axis=-2)[..., 0, :]
    out = out / np.linalg.norm(out, axis=-1, keepdims=True)
    unit: Array = np.where(out[..., 3:] < 0, -out, out)
    return unit


def rotation_from_quaternion(q_xyzw: Array) -> Array:
    """Rotation matrices of unit quaternions (x, y, z, w), (..., 4) to (..., 3, 3)."""
    v, w = q_xyzw[..., :3], q_xyzw[..., 3, None, None]
    k = hat(v)
    return np.eye(3) + 2 * w * k + 2 * (k @ k)


def nearest_rotation(matrix: Array) -> Array:
    """The rotation nearest in the Frobenius norm, (..., 3, 3). Source: Umeyama 1991."""
    u, _, vt = np.linalg.svd(matrix)
    sign = np.where(np.linalg.det(u @ vt) < 0, -1.0, 1.0)
    u = u.copy()
    u[..., :, 2] *= sign[..., None]
    rotation: Array = u @ vt
    return rotation


def checked_rotation(rotation: Array, name: str = "rotation") -> Array:
    """The nearest rotation of a matrix within 1e-3 of one, (..., 3, 3).

    Raises:
        InputError: if it is further away, or a reflection.
    """
    nearest = nearest_rotation(rotation)
    off = np.abs(nearest - rotation).max(initial=0.0)
    if off > ROTATION_TOLERANCE:
        raise InputError(f"{name} is not a rotation: off by {off:.2g}, at most {ROTATION_TOLERANCE:g} is projected")
    return nearest
