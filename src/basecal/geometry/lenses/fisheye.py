"""Fisheye lens of Kannala and Brandt with four terms: the same as cv2.fisheye, but also valid beyond 90 deg.

The image of a point at the angle t from the axis is at the distance d(t) from the centre. The distance is
d(t) = t (1 + k1 t^2 + k2 t^4 + k3 t^6 + k4 t^8).
Source: Kannala & Brandt 2006, doi:10.1109/TPAMI.2006.153; docs/mathematics.md (2.5).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from basecal.geometry.array import Array, BoolArray
from basecal.geometry.lens import Number, Projection, first_root

MODEL = "fisheye"
TERM_NAMES: tuple[str, ...] = ("k1", "k2", "k3", "k4")
TERMS: tuple[int, ...] = (4,)
TERM_SIGMAS: tuple[float, ...] = ()
USUAL_TERMS = 4
USUAL_FOCAL_PX = (480.0, 560.0)  # a field of view of 130 to 150 deg
# Bisection alone needs 48 steps from pi to the tolerance; Newton steps may be added between.
_MOST_STEPS = 80
_TOLERANCE = 1e-14  # tolerance of the angle [rad], some roundings


class _Polar(NamedTuple):
    """Polar coordinates of points: distance r from the axis [m], azimuth (cosine, sine), angle to the axis [rad]."""

    r: Array
    cosine: Array
    sine: Array
    angle: Array


def _polar(points: Array) -> _Polar:
    """Polar coordinates of points (..., 3); the angle is NaN on the axis if z <= 0."""
    x, y, z = points[..., 0], points[..., 1], points[..., 2]
    r = np.hypot(x, y)
    is_off_axis = r > 0
    safe = np.where(is_off_axis, r, 1.0)
    angle = np.where(is_off_axis | (z > 0), np.arctan2(r, z), np.nan)
    return _Polar(r, np.where(is_off_axis, x / safe, 1.0), y / safe, angle)


def _distance(angle: Array, distortion: Sequence[Number]) -> Array:
    k1, k2, k3, k4 = distortion
    s = angle * angle
    distance: Array = angle * ((((k4 * s + k3) * s + k2) * s + k1) * s + 1.0)
    return distance


def _distance_derivative(angle: Array, distortion: Sequence[Number]) -> Array:
    """Derivative of the image's distance from the centre with respect to the angle."""
    k1, k2, k3, k4 = distortion
    s = angle * angle
    growth: Array = (((9 * k4 * s + 7 * k3) * s + 5 * k2) * s + 3 * k1) * s + 1.0
    return growth


def project(points: Array, distortion: Sequence[Number]) -> tuple[Array, Array]:
    """Image on the plane at unit distance, (...,) each, of points (..., 3); NaN on the axis if z <= 0."""
    _, cosine, sine, angle = _polar(points)
    distance = _distance(angle, distortion)
    return cosine * distance, sine * distance


def project_with_derivatives(
    points: Array, focal: tuple[Number, Number], distortion: Sequence[Number], with_terms: bool
) -> Projection:
    """See `Lens`."""
    r, cosine, sine, angle = _polar(points)
    distance, growth = _distance(angle, distortion), _distance_derivative(angle, distortion)
    z = points[..., 2]
    square = r * r + z * z
    outward = growth * z / square
    around = np.where(r > 0, distance / np.where(r > 0, r, 1.0), outward)
    cross = cosine * sine * (outward - around)
    forward = -growth * r / square
    d_points = np.empty((*points.shape[:-1], 2, 3))
    d_points[..., 0, 0] = focal[0] * (cosine * cosine * outward + sine * sine * around)
    d_points[..., 0, 1], d_points[..., 1, 0] = focal[0] * cross, focal[1] * cross
    d_points[..., 1, 1] = focal[1] * (sine * sine * outward + cosine * cosine * around)
    d_points[..., 0, 2], d_points[..., 1, 2] = focal[0] * cosine * forward, focal[1] * sine * forward
    d_terms = None
    if with_terms:
        powers = angle[..., None] ** np.array([3, 5, 7, 9])
        d_terms = np.stack([(focal[0] * cosine)[..., None] * powers, (focal[1] * sine)[..., None] * powers], -2)
    return Projection(cosine * distance, sine * distance, d_points, d_terms)


def fold(distortion: list[float]) -> float:
    """Largest angle up to which the distance of the image increases [rad], at most pi."""
    return min(math.sqrt(first_root(np.array([1.0, *distortion]) * [1, 3, 5, 7, 9])), math.pi)


def domain_mask(points: Array, distortion: list[float]) -> BoolArray:
    """Whether points are inside the fold, (...,)."""
    inside: BoolArray = _polar(points).angle < fold(distortion)
    return inside


def unproject(u: Array, v: Array, distortion: list[float]) -> tuple[Array, BoolArray]:
    """Unit directions, (..., 3), with the image (u, v), and whether each is inside the fold, (...,).

    Newton's method on the angle, with bisection if a step would leave the bracket.
    """
    distance = np.hypot(u, v)
    low, high = np.zeros_like(distance), np.full_like(distance, fold(distortion))
    valid = distance < _distance(high, distortion)
    angle = np.minimum(distance, 0.5 * high)
    for _ in range(_MOST_STEPS):
        residual = distance - _distance(angle, distortion)
        low, high = np.where(residual > 0, angle, low), np.where(residual > 0, high, angle)
        newton = angle + residual / _distance_derivative(angle, distortion)
        next_angle = np.where((newton >= low) & (newton <= high), newton, 0.5 * (low + high))
        converged = np.abs(next_angle - angle) <= _TOLERANCE
        angle = next_angle
        if np.all(converged | ~valid):
            break
    safe = np.where(distance > 0, distance, 1.0)
    scale = np.sin(angle) / safe
    return np.stack([u * scale, v * scale, np.cos(angle)], -1), valid


def usual_distortion(rng: np.random.Generator) -> Array:
    """Draw distortion terms for a simulation, (4,)."""
    return rng.uniform(-1, 1, 4) * (0.03, 0.01, 0.003, 0.001)
