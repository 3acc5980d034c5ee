"""Euler angles of rotations, accurate near singularities, where single angles are ill-defined."""

from __future__ import annotations

import numpy as np

from basecal.geometry.array import Array

_LOCKED_COSINE = 1e-15  # cosine of the pitch below which there is gimbal lock: rounding


def rpy_of_rotation(rotation: Array) -> Array:
    """Angles about the fixed axes x, y, z of rotations, (..., 3, 3) to (..., 3) [rad]; their product is exact.

    Near a pitch of 90 deg, yaw alone is ill-defined. The roll follows from the rotation without the yaw; it is 0 at
    90 deg. Source: Shoemake 1994.
    """
    r = rotation
    cos_pitch = np.hypot(r[..., 0, 0], r[..., 1, 0])
    locked = cos_pitch < _LOCKED_COSINE
    yaw = np.arctan2(np.where(locked, -r[..., 0, 1], r[..., 1, 0]), np.where(locked, r[..., 1, 1], r[..., 0, 0]))
    pitch = np.arctan2(-r[..., 2, 0], cos_pitch)
    sin, cos = np.sin(yaw), np.cos(yaw)
    roll = np.arctan2(sin * r[..., 0, 2] - cos * r[..., 1, 2], cos * r[..., 1, 1] - sin * r[..., 0, 1])
    return np.stack([np.where(locked, 0.0, roll), pitch, yaw], -1)


def zyz_of_rotation(rotation: Array) -> Array:
    """Angles a, b, c of Rz(a) Ry(b) Rz(c), (..., 3, 3) to (..., 3) [rad], with b in [0, pi]; their product is exact.

    Near b = 0 or 180 deg, a alone is ill-defined. c follows from the rotation without a. Source: Shoemake 1994.
    """
    r = rotation
    first = np.arctan2(r[..., 1, 2], r[..., 0, 2])
    second = np.arctan2(np.hypot(r[..., 0, 2], r[..., 1, 2]), r[..., 2, 2])
    sin, cos = np.sin(first), np.cos(first)
    third = np.arctan2(cos * r[..., 1, 0] - sin * r[..., 0, 0], cos * r[..., 1, 1] - sin * r[..., 0, 1])
    return np.stack([first, second, third], -1)
