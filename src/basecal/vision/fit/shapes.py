"""Ideal pieces of targets under a Gaussian point spread, as functions of place.

Parameters of a corner, (n, 6): its place x, y [px], the directions of its two lines [rad], the logarithm of the point
spread's sigma, and how much the camera has sharpened the image, 0 for not at all. The sides of a line are given by the
signed distance to the right of its direction.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.special import ndtr

from basecal.geometry import Array

_MOST_LOG = 4.0  # of a width in pixels: 55 px is beyond every window, and no exponential overflows on the way
_MASK_PX = 1.2  # sigma of the blur that cameras sharpen with, in the middle of what is usual
_TINY = 1e-9  # [px, or 1] below which a quotient takes its limit: rounding of it is 1e-16 / 1e-9
_NODES, _WEIGHTS = (0.5 * each for each in np.polynomial.legendre.leggauss(4))


def saddle(q: Array, xy: Array) -> Array:
    """A chessboard's corner: +1 where both lines have the place on like sides, -1 elsewhere, (n, p)."""
    return _sharpened(_soft_saddle, q, xy)


def wedge(q: Array, xy: Array) -> Array:
    """A dark or bright corner: 1 where the place is on the positive side of both lines, 0 elsewhere, (n, p)."""
    return _sharpened(_soft_wedge, q, xy)


def _sharpened(shape: Callable[[Array, Array], Array], q: Array, xy: Array) -> Array:
    """What unsharp masking makes of a shape: what a further blur would take from it, added."""
    share = q[:, 5:6]
    if not share.any():
        return shape(q, xy)
    blurred = q.copy()
    blurred[:, 4] = 0.5 * np.logaddexp(2 * q[:, 4], 2 * np.log(_MASK_PX))
    return np.asarray((1 + share) * shape(q, xy) - share * shape(blurred, xy))


def _soft_saddle(q: Array, xy: Array) -> Array:
    first, second, between = _sides(q, xy)
    return np.asarray((2 * ndtr(first) - 1) * (2 * ndtr(second) - 1) + 4 * _overlap(first, second, between))


def _soft_wedge(q: Array, xy: Array) -> Array:
    first, second, between = _sides(q, xy)
    return np.asarray(ndtr(first) * ndtr(second) + _overlap(first, second, between))


def ellipse(q: Array, xy: Array) -> Array:
    """A disc's image: 1 inside, 0 outside, (n, p).

    Args:
        q: x, y [px]; a, b, c of the symmetric matrix exp(a, b; b, c) that takes the unit circle to the outline [px];
            the logarithm of the point spread's sigma, (n, 6).
        xy: (n, p, 2) [px].
    """
    offset = xy - q[:, None, :2]
    matrix = _symmetric_exp(-q[:, 2], -q[:, 3], -q[:, 4])
    mapped = offset @ matrix
    radius = np.hypot(mapped[..., 0], mapped[..., 1])
    outward = mapped @ matrix
    slope = np.hypot(outward[..., 0], outward[..., 1]) / np.maximum(radius, _TINY)
    distance = (1 - radius) / np.maximum(slope, _TINY)
    return np.asarray(ndtr(distance * np.exp(-np.clip(q[:, 5:6], -_MOST_LOG, _MOST_LOG))))


def _sides(q: Array, xy: Array) -> tuple[Array, Array, Array]:
    """Distances to the right of both lines in sigmas, (n, p) each, and the cosine between their normals, (n, 1)."""
    offset = (xy - q[:, None, :2]) * np.exp(-np.clip(q[:, 4], -_MOST_LOG, _MOST_LOG))[:, None, None]
    cosine, sine = np.cos(q[:, 2:4])[:, None], np.sin(q[:, 2:4])[:, None]
    first, second = np.moveaxis(offset[..., 1:] * cosine - offset[..., :1] * sine, -1, 0)
    return first, second, np.cos(q[:, 2:3] - q[:, 3:4])


def _overlap(first: Array, second: Array, between: Array) -> Array:
    """The normal probability that two correlated numbers are both positive, beyond the product, (n, p).

    Its derivative to the correlation is the density (Price's theorem); the integral over it by Gauss-Legendre in the
    arc's sine, which is smooth up to correlation one. Source: Drezner & Wesolowsky 1990.
    """
    total = np.zeros_like(first)
    product, squares = first * second, 0.5 * (first**2 + second**2)
    top = np.arcsin(np.clip(between, -1, 1))
    for node, weight in zip(_NODES + 0.5, _WEIGHTS, strict=True):
        sine, cosine2 = np.sin(top * node), np.cos(top * node) ** 2
        total += weight * np.exp((sine * product - squares) / cosine2)
    return np.asarray(total * top / (2 * np.pi))


def _symmetric_exp(a: Array, b: Array, c: Array) -> Array:
    """The exponential of (a, b; b, c), (n, 2, 2)."""
    a, b, c = (np.clip(each, -2 * _MOST_LOG, 2 * _MOST_LOG) for each in (a, b, c))
    mean, half = (a + c) / 2, (a - c) / 2
    radius = np.hypot(half, b)
    ratio = np.where(radius > _TINY, np.sinh(radius) / np.maximum(radius, _TINY), 1.0)
    scale, cosh = np.exp(mean), np.cosh(radius)
    return np.stack(
        [scale * (cosh + ratio * half), scale * ratio * b, scale * ratio * b, scale * (cosh - ratio * half)], -1
    ).reshape(-1, 2, 2)
