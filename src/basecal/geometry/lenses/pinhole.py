"""Brown-Conrady lens in OpenCV's order k1 k2 p1 p2 [k3 [k4 k5 k6]], on the plane at unit distance.

The image of a point (a, b, 1) is `(a radial + 2 p1 a b + p2 (s + 2 a^2), b radial + p1 (s + 2 b^2) + 2 p2 a b)`. Here
`s = a^2 + b^2` and `radial = (1 + k1 s + k2 s^2 + k3 s^3) / (1 + k4 s + k5 s^2 + k6 s^3)`. Its Jacobian is symmetric.
Source: Brown 1971, "Close-range camera calibration"; the rational terms as in OpenCV;
docs/mathematics.md (2.3), (2.4), (2.6).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from basecal.geometry.array import Array, BoolArray, to_back
from basecal.geometry.lens import Image, Number, Projection, any_nonzero, first_root, invert_map

MODEL = "pinhole"
TERM_NAMES: tuple[str, ...] = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")
TERMS: tuple[int, ...] = (0, 4, 5, 8)
# From calibrated lenses: p1, p2 of sixteen cameras (TUM RGB-D, KITTI, EuRoC, `camera_info` files) have an RMS of
# 3.3e-3. Without these priors, tilt and centre are not separable from p1, p2 in a few views, nor k1, k2 from k3.
# Smaller sigmas of p1 and p2 would bias the mount for such lenses. With a larger sigma of k3, ten views of a wide lens
# would not determine its rim.
TERM_SIGMAS: tuple[float, ...] = (math.inf, math.inf, 3e-3, 3e-3, 0.1)
USUAL_TERMS = 5
USUAL_FOCAL_PX = (860.0, 940.0)  # a field of view of about 70 deg


class _Rays(NamedTuple):
    """Points (a, b, 1), their radial factor, and the common factor `stretch` of a and b, (...,) each.

    The image is (a stretch + p2 s, b stretch + p1 s) with stretch = radial + 2 p1 b + 2 p2 a.
    """

    a: Array
    b: Array
    s: Array
    radial: Array
    stretch: Array
    inverse_denominator: Array | float


def _rays(a: Array, b: Array, k: Sequence[Number]) -> _Rays:
    k1, k2, p1, p2, k3, k4, k5, k6 = k
    s = a * a
    s += b * b
    radial = _polynomial(s, (1.0, k1, k2, k3))
    inverse: Array | float = 1.0
    if any_nonzero((k4, k5, k6)):
        inverse = 1.0 / _polynomial(s, (1.0, k4, k5, k6))
        radial *= inverse
    stretch = (2 * p1) * b
    stretch += (2 * p2) * a
    stretch += radial
    return _Rays(a, b, s, radial, stretch, inverse)


def _polynomial(s: Array, coefficients: tuple[Number, ...]) -> Array:
    """Evaluate the polynomial with coefficients c_i at s by Horner's method."""
    total: Array = coefficients[-1] * s
    for c in coefficients[-2:0:-1]:
        total += c
        total *= s
    total += coefficients[0]
    return total


def normalise(points: Array) -> tuple[Array, Array, Array]:
    """Coordinates a = x / z, b = y / z, and 1 / z of points (..., 3), (...,) each; NaN if z <= 0."""
    z = points[..., 2]
    ahead = z > 0
    inverse = 1.0 / (z if ahead.all() else np.where(ahead, z, np.nan))
    return points[..., 0] * inverse, points[..., 1] * inverse, inverse


def _pad_distortion(distortion: Sequence[Number]) -> list[Number]:
    return [*distortion, *[0.0] * (8 - len(distortion))]


def _image(rays: _Rays, k: Sequence[Number]) -> tuple[Array, Array]:
    p1, p2 = k[2:4]
    u, v = rays.a * rays.stretch, rays.b * rays.stretch
    u += p2 * rays.s
    v += p1 * rays.s
    return u, v


def _derivative(rays: _Rays, k: Sequence[Number]) -> tuple[Array, Array, Array]:
    """Derivatives du/da, du/db (equal to dv/da) and dv/db, (...,) each."""
    k1, k2, p1, p2, k3, k4, k5, k6 = k
    slope = _polynomial(rays.s, (2 * k1, 4 * k2, 6 * k3))
    if any_nonzero((k4, k5, k6)):
        slope -= rays.radial * _polynomial(rays.s, (2 * k4, 4 * k5, 6 * k6))
        slope *= rays.inverse_denominator
    slope_a = slope * rays.a
    mixed = slope_a + 2 * p2
    mixed *= rays.b
    mixed += (2 * p1) * rays.a
    return (
        _diagonal_derivative(slope_a, p2, rays.a, rays.stretch),
        mixed,
        _diagonal_derivative(slope * rays.b, p1, rays.b, rays.stretch),
    )


def _diagonal_derivative(slope: Array, p: Number, coordinate: Array, stretch: Array) -> Array:
    """Diagonal entry of the Jacobian: derivative of an image coordinate with respect to its own coordinate."""
    total = slope + 4 * p
    total *= coordinate
    total += stretch
    return total


def project(points: Array, distortion: Sequence[Number]) -> tuple[Array, Array]:
    """Image on the plane at unit distance, (...,) each, of points (..., 3); NaN if z <= 0."""
    a, b, _ = normalise(points)
    if not any_nonzero(distortion):
        return a, b
    k = _pad_distortion(distortion)
    return _image(_rays(a, b, k), k)


def project_with_derivatives(
    points: Array, focal: tuple[Number, Number], distortion: Sequence[Number], with_terms: bool
) -> Projection:
    """See `Lens`."""
    a, b, inverse = normalise(points)
    d_points = allocate_rows(2, 3, points.shape[:-1])
    if not (any_nonzero(distortion) or (with_terms and distortion)):
        _undistorted_rows(d_points, a, b, inverse, focal)
        return Projection(a, b, d_points, np.empty((*points.shape[:-1], 2, 0)) if with_terms else None)
    k = _pad_distortion(distortion)
    rays = _rays(a, b, k)
    uu, uv, vv = _derivative(rays, k)
    for row, (f, da, db) in enumerate(((focal[0], uu, uv), (focal[1], uv, vv))):
        scale = f * inverse
        dx = np.multiply(scale, da, out=d_points[..., row, 0])
        dy = np.multiply(scale, db, out=d_points[..., row, 1])
        np.negative(dx * a + dy * b, out=d_points[..., row, 2])
    return Projection(
        *_image(rays, k), d_points, _term_derivative(rays, focal, len(distortion)) if with_terms else None
    )


def allocate_rows(rows: int, columns: int, shape: tuple[int, ...]) -> Array:
    """Allocate an array (*shape, rows, columns) in which all values of one entry are contiguous, for fast access."""
    return to_back(np.empty((rows, columns, *shape)), 2)


def _undistorted_rows(output: Array, a: Array, b: Array, inverse: Array, focal: tuple[Number, Number]) -> None:
    for row, (f, coordinate) in enumerate(zip(focal, (a, b), strict=True)):
        scale = f * inverse
        output[..., row, row] = scale
        output[..., row, 1 - row] = 0.0 * scale  # NaN stays NaN
        np.multiply(scale, -coordinate, out=output[..., row, 2])


def _term_derivative(rays: _Rays, focal: tuple[Number, Number], count: int) -> Array:
    """Derivative of the pixels with respect to the first `count` distortion terms, (..., 2, count)."""
    out = allocate_rows(2, count, rays.s.shape)
    power = rays.s * rays.inverse_denominator
    for row, (f, coordinate, other_coordinate) in enumerate(((focal[0], rays.a, rays.b), (focal[1], rays.b, rays.a))):
        scaled = f * coordinate
        first = np.multiply(scaled, power, out=out[..., row, 0])
        second = np.multiply(first, rays.s, out=out[..., row, 1])
        scaled *= 2
        np.multiply(scaled, other_coordinate, out=out[..., row, 2 + row])
        np.add(scaled * coordinate, f * rays.s, out=out[..., row, 3 - row])
        if count > 4:
            third = np.multiply(second, rays.s, out=out[..., row, 4])
        if count > 5:
            for term, powered in zip((5, 6, 7), (first, second, third), strict=True):
                np.multiply(powered, -rays.radial, out=out[..., row, term])
    return out


def fold(distortion: list[float]) -> float:
    """Largest s = a^2 + b^2 up to which the radial image increases with the radius; infinite if it always does."""
    k1, k2, _, _, k3, k4, k5, k6 = _pad_distortion(distortion)
    if not any((k4, k5, k6)):
        return first_root(np.array([1.0, 3 * k1, 5 * k2, 7 * k3]))
    top, bottom = np.array([1.0, k1, k2, k3]), np.array([1.0, k4, k5, k6])
    ramp = 2.0 * np.arange(4)
    growth = np.convolve(top, bottom) + np.convolve(ramp * top, bottom) - np.convolve(top, ramp * bottom)
    return min(first_root(growth), first_root(bottom))


def domain_mask(points: Array, distortion: list[float]) -> BoolArray:
    """Whether points are in front of the camera and inside the fold, (...,)."""
    a, b, _ = normalise(points)
    inside: BoolArray = a * a + b * b < fold(distortion)
    return inside


def unproject(u: Array, v: Array, distortion: list[float]) -> tuple[Array, BoolArray]:
    """Directions (a, b, 1), (..., 3), with the image (u, v), and whether each is inside the fold, (...,)."""
    k = _pad_distortion(distortion)
    return invert_map(lambda a, b: project_direction(a, b, k), u, v, fold(distortion))


def project_direction(a: Array, b: Array, k: Sequence[Number]) -> Image:
    """Image of directions (a, b, 1), (...,) each, and its derivatives, for all eight terms k."""
    rays = _rays(a, b, k)
    uu, uv, vv = _derivative(rays, k)
    return Image(*_image(rays, k), uu, uv, uv, vv)


def usual_distortion(rng: np.random.Generator) -> Array:
    """Draw distortion terms for a simulation, (5,): a slight barrel distortion."""
    return np.array([-0.08, 0.02, 0, 0, 0]) + rng.uniform(-1, 1, 5) * (0.05, 0.02, 1e-3, 1e-3, 0.005)
