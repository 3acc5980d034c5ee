"""The image of a disc under a Gaussian point spread, as a function of position."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.special import ndtr

from basecal.geometry import Array

_MOST_LOG = 4.0  # of a width in pixels: 55 px exceeds every window, and no exponential overflows
_LEAST_DIVISOR = 1e-9  # [px, or 1] below which a quotient is replaced by its limit: its rounding is 1e-16 / 1e-9
_DIFFERENCE_STEP = 1e-5  # of a logarithm: curvature and rounding leave ten digits of a derivative


class Ellipse:
    """The image of a disc: 1 inside, 0 outside; see `Shape`.

    An ellipse has six parameters, (n, 6). The first two are the centre x, y [px]. The next three are a, b, c of the
    symmetric matrix exp(a, b; b, c) that maps the unit circle to the outline [px]. The last is the logarithm of the
    point spread's sigma.
    """

    def __call__(self, q: Array, xy: Array) -> Array:
        """See `Shape`."""
        return np.asarray(ndtr(_ellipse_terms(q, xy).z))

    def linearise_shape(self, q: Array, xy: Array, free: int) -> tuple[Array, Array]:
        """See `Shape`."""
        terms = _ellipse_terms(q, xy)
        # Derivatives of z = s r (1 - r) / |o| to r^2 and |o|^2, with r^2 = offset . o and o = G offset.
        by_square = terms.sharpness * (1 - 2 * terms.radius) / (2 * terms.radius * terms.size)
        by_size = -0.5 * terms.z / terms.size**2
        u, v = terms.offset
        du, dv = terms.outward
        g11, g12, g22 = terms.metric
        rows = [by_square * -2 * du - 2 * by_size * (du * g11 + dv * g12)]
        rows.append(by_square * -2 * dv - 2 * by_size * (du * g12 + dv * g22))
        uu, uv, vv = u * u, 2 * u * v, v * v
        # Derivatives of G's entries with respect to a, b and c, by finite differences.
        for step in _DIFFERENCE_STEP * np.eye(3):
            less, more = (_symmetric_exp(*(-(q[:, 2:5] + side * step)).T) for side in (-1, 1))
            h11, h12, h22 = _entries((more @ more - less @ less) / (2 * _DIFFERENCE_STEP))
            of_size = 2 * (du * (u * h11 + v * h12) + dv * (u * h12 + v * h22))
            rows.append(by_square * (uu * h11 + uv * h12 + vv * h22) + by_size * of_size)
        rows.append(-terms.z * (np.abs(q[:, 5:6]) < _MOST_LOG))
        height = np.exp(-0.5 * terms.z**2) / np.sqrt(2 * np.pi)
        return np.asarray(ndtr(terms.z)), np.stack([height * row for row in rows[:free]], axis=1)


class _EllipseTerms(NamedTuple):
    """Terms at positions near ellipses, (n, p) each.

    Attributes:
        z: Distance inside the outline in sigmas of the point spread, to first order.
        radius: Radius r after the map of the outline to the unit circle.
        size: Length of `outward`.
        offset: Offset from the centre, u and v.
        outward: Gradient of r^2 / 2, G offset.
        metric: Entries 11, 12 and 22 of G, (n, 1).
        sharpness: 1 / sigma of the point spread, (n, 1).
    """

    z: Array
    radius: Array
    size: Array
    offset: tuple[Array, Array]
    outward: tuple[Array, Array]
    metric: tuple[Array, Array, Array]
    sharpness: Array


def _ellipse_terms(q: Array, xy: Array) -> _EllipseTerms:
    u, v = xy[..., 0] - q[:, :1], xy[..., 1] - q[:, 1:2]
    matrix = _symmetric_exp(-q[:, 2], -q[:, 3], -q[:, 4])
    g11, g12, g22 = _entries(matrix @ matrix)
    du, dv = g11 * u + g12 * v, g12 * u + g22 * v
    radius = np.maximum(np.sqrt(np.maximum(u * du + v * dv, 0.0)), _LEAST_DIVISOR)
    size = np.maximum(np.hypot(du, dv), _LEAST_DIVISOR * radius)
    sharpness = np.exp(-np.clip(q[:, 5:6], -_MOST_LOG, _MOST_LOG))
    z = sharpness * radius * (1 - radius) / size
    return _EllipseTerms(z, radius, size, (u, v), (du, dv), (g11, g12, g22), sharpness)


def _entries(matrix: Array) -> tuple[Array, Array, Array]:
    """Entries 11, 12 and 22 of symmetric matrices, (n, 1) each."""
    return matrix[:, 0, :1], matrix[:, 0, 1:], matrix[:, 1, 1:]


ellipse = Ellipse()


def _symmetric_exp(a: Array, b: Array, c: Array) -> Array:
    """Exponential of the symmetric matrix (a, b; b, c), (n, 2, 2)."""
    a, b, c = (np.clip(each, -2 * _MOST_LOG, 2 * _MOST_LOG) for each in (a, b, c))
    mean, half = (a + c) / 2, (a - c) / 2
    radius = np.hypot(half, b)
    ratio = np.where(radius > _LEAST_DIVISOR, np.sinh(radius) / np.maximum(radius, _LEAST_DIVISOR), 1.0)
    scale, cosh = np.exp(mean), np.cosh(radius)
    return np.stack(
        [scale * (cosh + ratio * half), scale * ratio * b, scale * ratio * b, scale * (cosh - ratio * half)], -1
    ).reshape(-1, 2, 2)
