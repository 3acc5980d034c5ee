"""A disc's image under a Gaussian point spread, as a function of place."""

from __future__ import annotations

import numpy as np
from scipy.special import ndtr

from basecal.geometry import Array

_MOST_LOG = 4.0  # of a width in pixels: 55 px is beyond every window, and no exponential overflows on the way
_TINY = 1e-9  # [px, or 1] below which a quotient takes its limit: rounding of it is 1e-16 / 1e-9
_DIFFERENCE = 1e-5  # [px, log]: the derivative's curvature and the values' rounding are both far below noise


class Ellipse:
    """A disc's image: 1 inside, 0 outside; see `Shape`.

    Parameters: x, y [px]; a, b, c of the symmetric matrix exp(a, b; b, c) that takes the unit circle to the outline
    [px]; the logarithm of the point spread's sigma, (n, 6).
    """

    def __call__(self, q: Array, xy: Array) -> Array:
        """See `Shape`."""
        offset = xy - q[:, None, :2]
        matrix = _symmetric_exp(-q[:, 2], -q[:, 3], -q[:, 4])
        mapped = offset @ matrix
        radius = np.hypot(mapped[..., 0], mapped[..., 1])
        outward = mapped @ matrix
        slope = np.hypot(outward[..., 0], outward[..., 1]) / np.maximum(radius, _TINY)
        distance = (1 - radius) / np.maximum(slope, _TINY)
        return np.asarray(ndtr(distance * np.exp(-np.clip(q[:, 5:6], -_MOST_LOG, _MOST_LOG))))

    def linearised(self, q: Array, xy: Array, free: int) -> tuple[Array, Array]:
        """See `Shape`; by differences."""
        values = self(q, xy)
        moved = [self(q + _DIFFERENCE * unit, xy) for unit in np.eye(free, q.shape[1])]
        return values, (np.stack(moved, axis=1) - values[:, None]) / _DIFFERENCE


ellipse = Ellipse()


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
