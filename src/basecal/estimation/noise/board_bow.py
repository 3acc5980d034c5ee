"""Boards that are not as flat as stated: a quadratic surface in place of the plane, its coefficients under a prior.

A printed board is bowed by 0.1 to 0.6 % of its half size. Seen at a slant that moves corners by a pixel and more, in
all views alike, and where it is left out lens and mounts take it up. Source: docs/mathematics.md (5.5).
"""

from __future__ import annotations

import numpy as np

from basecal.geometry import Array
from basecal.numerics.spectral import least_norm, principal_axes

# One standard deviation of a coefficient, of the half size: the middle of the 0.1 to 0.6 % above.
_SIGMA = 3e-3
_STEEP = 0.9  # component of the normal beyond which an axis of the target does not serve as one of the plane
COEFFICIENTS = 3


def bow_of(points_in_target: Array) -> Array:
    """How the points of a flat target, (p, 3) [m], move by each coefficient of its bow, (p, 3, 3) [m per sigma].

    The coefficients are those of u^2, u v and v^2, with u and v from -1 to 1 over the half size.
    """
    plane, normal = _plane(points_in_target)
    half = float(np.abs(plane).max())
    u, v = (plane / half).T
    heights = _SIGMA * half * np.column_stack([u * u, u * v, v * v])
    return np.asarray(heights[:, None, :] * normal[None, :, None])


def _plane(points_in_target: Array) -> tuple[Array, Array]:
    """Places in the plane of points from their middle, (p, 2) [m], and the unit vector across it, (3,).

    The axes are those of the target turned least: which they are does not hang on the points' shape.
    """
    centred = points_in_target - points_in_target.mean(0)
    normal = principal_axes(centred).axes[:, 2]
    normal = np.copysign(1.0, normal[np.argmax(np.abs(normal))]) * normal
    first = np.eye(3)[0 if abs(normal[0]) < _STEEP else 1]
    u = first - (first @ normal) * normal
    u /= np.linalg.norm(u)
    return centred @ np.column_stack([u, np.cross(normal, u)]), normal


def height_m(points_in_target: Array, bow: Array) -> float:
    """How far a bowed target's points lie from their own plane, the largest distance [m]."""
    plane, normal = _plane(points_in_target)
    heights = (bow_of(points_in_target) @ bow) @ normal
    rows = np.column_stack([plane, np.ones(len(plane))])
    return float(np.abs(heights - rows @ least_norm(rows, heights)).max())
