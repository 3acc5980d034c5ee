"""Rotation matrices, batched over leading axes: exponential, logarithm and quaternions.

Below 0.5 rad all coefficients are computed by series, since the closed forms suffer from cancellation.
"""

from __future__ import annotations

from collections.abc import Callable
from math import factorial

import numpy as np

from basecal.errors import InputError
from basecal.geometry.array import Array, entry_clause

_SERIES_LIMIT_RAD = 0.5
_NEXT_AXIS = np.array([1, 2, 0])
_SHORT_SERIES_TERMS, _SHORT_SERIES_LIMIT_RAD = 4, 0.03  # below this [rad]: 0.03^8 / 9! is a sixtieth of rounding
_NUMERATORS: tuple[Callable[[Array, Array, Array], Array], ...] = (  # functions of x, its sine and its cosine
    lambda x, sine, cosine: sine,
    lambda x, sine, cosine: 1 - cosine,
    lambda x, sine, cosine: x - sine,
    lambda x, sine, cosine: 0.5 * x * x + cosine - 1,
    lambda x, sine, cosine: x * x * x / 6 - x + sine,
)
_RECIPROCALS = np.array([[(-1) ** k / factorial(2 * k + first) for first in range(1, 6)] for k in range(9)])
ROTATION_TOLERANCE = 1e-3


def cross_matrix(w: Array) -> Array:
    """Cross-product matrices, (..., 3) to (..., 3, 3): `cross_matrix(w) @ v == cross(w, v)`."""
    out = np.zeros((*w.shape, 3))
    out[..., 0, 1], out[..., 0, 2], out[..., 1, 2] = -w[..., 2], w[..., 1], -w[..., 0]
    out[..., 1, 0], out[..., 2, 0], out[..., 2, 1] = w[..., 2], -w[..., 1], w[..., 0]
    return out


def exp_coefficients(angle: Array, count: int = 3) -> Array:
    """First `count` coefficients of `sin x / x, (1 - cos x) / x^2, (x - sin x) / x^3, ...`, (count, ...).

    The fourth is `(x^2 / 2 + cos x - 1) / x^4`, the fifth `(x^3 / 6 - x + sin x) / x^5`. All are exact near zero.

    Args:
        angle: (...) [rad], not negative.
        count: Number of coefficients, up to five.
    """
    largest = angle.max(initial=0.0)
    all_small = bool(largest < _SERIES_LIMIT_RAD)
    small = all_small or angle < _SERIES_LIMIT_RAD
    x2 = angle * angle if all_small else np.where(small, angle * angle, 0.0)
    terms = _SHORT_SERIES_TERMS if largest < _SHORT_SERIES_LIMIT_RAD else len(_RECIPROCALS)
    coefficients = _RECIPROCALS[:terms, :count].reshape(-1, count, *[1] * angle.ndim)
    values: Array = coefficients[-1] * x2
    for coefficient in coefficients[-2:0:-1]:  # Horner's method
        values += coefficient
        values *= x2
    values += coefficients[0]
    if not all_small:
        x = np.where(small, 1.0, angle)
        sine, cosine = np.sin(x), np.cos(x)
        power = x
        for k in range(count):
            values[k] = np.where(small, values[k], _NUMERATORS[k](x, sine, cosine) / power)
            power = power * x
    return values


def cross(left: Array, right: Array) -> Array:
    """Cross products of vectors, (..., 3): three times as fast as `np.cross`."""
    a, b = left[..., _NEXT_AXIS], right[..., _NEXT_AXIS]
    product: Array = (left * b - right * a)[..., _NEXT_AXIS]
    return product


def lengths(vectors: Array) -> Array:
    """Euclidean norms of vectors, (..., k) to (...,): twice as fast as `np.linalg.norm`."""
    norms: Array = np.sqrt(np.einsum("...i,...i->...", vectors, vectors))
    return norms


def with_identity(matrix: Array, share: Array) -> Array:
    """Add a multiple of the identity, (...), to matrices (..., 3, 3) in place, and return them."""
    diagonal = np.einsum("...ii->...i", matrix)  # a view
    diagonal += share[..., None]
    return matrix


def rotation_exp(w: Array) -> Array:
    """Rotation matrices of rotation vectors, (..., 3) [rad] to (..., 3, 3)."""
    angle = lengths(w)
    a, b = exp_coefficients(angle, 2)
    # The square of the cross-product matrix of w is w w' - w'w I.
    rotation = cross_matrix(a[..., None] * w) + (b[..., None] * w)[..., :, None] * w[..., None, :]
    return with_identity(rotation, 1 - b * (angle * angle))


def rotation_log(rotation: Array) -> Array:
    """Rotation vectors of rotation matrices, (..., 3, 3) to (..., 3) [rad], angle in [0, pi].

    Computed from the quaternion, which is well conditioned at every angle.
    """
    q = quaternion_from_rotation(rotation)
    v, w = q[..., :3], q[..., 3]
    norm = np.linalg.norm(v, axis=-1)
    safe = np.where(norm > 0, norm, 1.0)
    # atan2(n, w) / n tends to 1 / w as n tends to zero; w >= 0 by construction.
    scale = np.where(norm > 0, 2 * np.arctan2(norm, w) / safe, 2.0)
    return v * scale[..., None]


def quaternion_from_rotation(rotation: Array) -> Array:
    """Unit quaternions (x, y, z, w) with w >= 0 of rotation matrices, (..., 3, 3) to (..., 4).

    Source: Shepperd 1978: the divisor is the largest of four exact expressions.
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
    k = cross_matrix(v)
    return np.eye(3) + 2 * w * k + 2 * (k @ k)


def nearest_rotation(matrix: Array) -> Array:
    """Nearest rotations in the Frobenius norm, (..., 3, 3). Source: Umeyama 1991."""
    u, _, vt = np.linalg.svd(matrix)
    rotation: Array = u @ vt
    mirrored = np.linalg.det(rotation) < 0
    if not mirrored.any():
        return rotation
    u[..., :, 2] *= np.where(mirrored, -1.0, 1.0)[..., None]
    rotation = u @ vt
    return rotation


def check_rotation(rotation: Array, name: str = "rotation") -> None:
    """Check that finite matrices, (..., 3, 3), are rotations within 1e-3.

    Raises:
        InputError: if a matrix is scaled, sheared or a reflection.
    """
    deviation = np.abs(rotation.mT @ rotation - np.eye(3)).max(initial=0.0)  # NaN if a state is not finite
    if deviation > 2 * ROTATION_TOLERANCE:
        raise InputError(f"{name} is not a rotation: R' R is off the identity by {deviation:.2g}")
    if np.any(np.einsum("...i,...i->...", cross(rotation[..., 0], rotation[..., 1]), rotation[..., 2]) < 0):
        raise InputError(f"{name} is a reflection: its determinant is -1, its axes are left-handed")


def project_rotation(rotation: Array, name: str = "rotation") -> Array:
    """Nearest rotations of matrices that are rotations within 1e-3, (..., 3, 3).

    Raises:
        InputError: if a matrix is farther from a rotation, or a reflection.
    """
    nearest = nearest_rotation(rotation)
    deviations = np.abs(nearest - rotation).max(axis=(-2, -1), initial=0.0)
    if np.any(is_wrong := deviations > ROTATION_TOLERANCE):
        is_mirrored = np.any(np.linalg.det(rotation)[is_wrong] < 0)
        cause = ": its axes are left-handed" if is_mirrored else f", at most {ROTATION_TOLERANCE:g} is projected"
        where, off = entry_clause(is_wrong), deviations[is_wrong][0]
        raise InputError(f"{name} is not a rotation{where}: off by {off:.2g}{cause}")
    return nearest
