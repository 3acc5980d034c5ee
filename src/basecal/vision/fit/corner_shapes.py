"""Ideal corners under a Gaussian point spread, as functions of position, with their derivatives.

A corner has six parameters, (n, 6). The first four are its position x, y [px] and the directions of its two lines
[rad]. The others are the logarithm of the point spread's sigma, and the sharpening of the image by the camera, 0 for
none. The side of a line is the sign of the distance to the right of its direction.

The value of a wedge is the probability that a point, displaced by the point spread, is to the right of both lines. This
is the bivariate normal distribution function Phi2(a, b; r) of both distances in sigmas, with the cosine r between the
lines. Its derivative with respect to a is phi(a) Phi((b - r a) / sqrt(1 - r^2)), with a and b exchanged for b. The
derivative with respect to r is the density phi2(a, b; r) (Price's theorem). A saddle is 4 Phi2(a, b; r) - 2 Phi(a) -
2 Phi(b) + 1.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.special import ndtr

from basecal.geometry import Array, BoolArray

LEAST_LOG_SPREAD = float(np.log(0.25))
"""Smallest logarithm of a spread in pixels: the pixel's square alone has a sigma of 0.29 px."""

_MOST_LOG = 4.0  # of a width in pixels: 55 px exceeds every window, and no exponential overflows
_MASK_PX = 1.2  # typical sigma of the blur in a camera's unsharp masking
_LEAST_SINE2 = 1e-6  # of lines a thousandth of a radian apart: closer lines form no corner
_DENSITY = 1 / np.sqrt(2 * np.pi)
_NODES, _WEIGHTS = (0.5 * each for each in np.polynomial.legendre.leggauss(4))


@dataclass(frozen=True)
class Corner:
    """A corner's image; see `Shape`.

    Attributes:
        crossed: Whether its lines extend in both directions. The value is then +1 at points on the same side of both
            lines, and -1 elsewhere. Otherwise the value is 1 to the right of both lines, and 0 elsewhere.
    """

    crossed: bool

    def __call__(self, q: Array, xy: Array) -> Array:
        """See `Shape`."""
        sides, share = _sides(q, xy), q[:, 5:6]
        plain = self._values(_scale_sides(sides, q[:, 4:5]))
        if not share.any():
            return plain
        return (1 + share) * plain - share * self._values(_scale_sides(sides, _sharpened_spread(q[:, 4:5])))

    def linearise_shape(self, q: Array, xy: Array, free: int) -> tuple[Array, Array]:
        """See `Shape`."""
        sides, share = _sides(q, xy), q[:, 5:6]
        log_spread = q[:, 4:5]
        values, slopes = self._slopes(_scale_sides(sides, log_spread))
        if not share.any() and free < q.shape[1]:
            return values, _chain_slopes(sides, slopes, free)
        masked = _sharpened_spread(log_spread)
        blurred, others = self._slopes(_scale_sides(sides, masked))
        # Unsharp masking: the difference to a blurred copy is added.
        rate = np.exp(2 * (log_spread - masked))  # derivative of the blurred spread's logarithm to the sharp one's
        both = _Slopes(*((1 + share) * mine - share * theirs for mine, theirs in zip(slopes, others, strict=True)))
        both = both._replace(spread=(1 + share) * slopes.spread - share * rate * others.spread)
        jacobian = _chain_slopes(sides, both, min(free, 5))
        if free == q.shape[1]:
            jacobian = np.concatenate([jacobian, (values - blurred)[:, None]], axis=1)
        return (1 + share) * values - share * blurred, jacobian

    def _values(self, sides: _Scaled) -> Array:
        first, second = ndtr(sides.first), ndtr(sides.second)
        if self.crossed:
            return np.asarray((2 * first - 1) * (2 * second - 1) + 4 * _overlap(sides))
        return np.asarray(first * second + _overlap(sides))

    def _slopes(self, sides: _Scaled) -> tuple[Array, _Slopes]:
        """Values, and their derivatives."""
        a, b, r = sides.first, sides.second, sides.cosine
        root = np.sqrt(np.maximum(1 - r * r, _LEAST_SINE2))
        a_given_b, b_given_a = (a - r * b) / root, (b - r * a) / root
        by_first = _DENSITY * np.exp(-0.5 * a * a)
        by_cosine = by_first * np.exp(-0.5 * b_given_a * b_given_a) * (_DENSITY / root)
        by_first *= ndtr(b_given_a) - 0.5 * self.crossed
        by_second = _DENSITY * np.exp(-0.5 * b * b) * (ndtr(a_given_b) - 0.5 * self.crossed)
        times = 4.0 if self.crossed else 1.0
        by_spread = -(a * by_first + b * by_second) * sides.bounded
        slopes = _Slopes(by_first * sides.inverse, by_second * sides.inverse, by_cosine, by_spread)
        return self._values(sides), _Slopes(*(times * each for each in slopes))


saddle = Corner(crossed=True)
"""Corner of a chessboard."""

wedge = Corner(crossed=False)
"""Corner of a dark or bright area."""


class _Sides(NamedTuple):
    """Distances to the right of both lines and along them [px], (n, p) each; sine and cosine from line to line."""

    first: Array
    second: Array
    along_first: Array
    along_second: Array
    cosines: Array
    sines: Array
    cosine: Array
    sine: Array


def _sides(q: Array, xy: Array) -> _Sides:
    x, y = xy[..., 0] - q[:, 0:1], xy[..., 1] - q[:, 1:2]
    cosines, sines = np.cos(q[:, 2:4]), np.sin(q[:, 2:4])
    (c1, c2), (s1, s2) = (np.split(each, 2, axis=1) for each in (cosines, sines))
    turn = q[:, 2:3] - q[:, 3:4]
    right = (y * c1 - x * s1, y * c2 - x * s2)
    return _Sides(*right, x * c1 + y * s1, x * c2 + y * s2, cosines, sines, np.cos(turn), np.sin(turn))


class _Scaled(NamedTuple):
    """Distances from both lines in sigmas of the point spread, (n, p), their cosine and 1 / sigma [1/px], (n, 1).

    `bounded`, (n, 1), is true if the spread is within its bounds. Otherwise the spread is clipped to a bound, since an
    infinitely sharp edge could be anywhere between the centres of two pixels.
    """

    first: Array
    second: Array
    cosine: Array
    inverse: Array
    bounded: BoolArray


def _scale_sides(sides: _Sides, log_spread: Array) -> _Scaled:
    inverse = np.exp(-np.clip(log_spread, LEAST_LOG_SPREAD, _MOST_LOG))
    bounded = (log_spread > LEAST_LOG_SPREAD) & (log_spread < _MOST_LOG)
    return _Scaled(sides.first * inverse, sides.second * inverse, sides.cosine, inverse, bounded)


def _sharpened_spread(log_spread: Array) -> Array:
    """Logarithm of the spread after an additional blur by the camera's unsharp mask."""
    return np.asarray(0.5 * np.logaddexp(2 * log_spread, 2 * np.log(_MASK_PX)))


class _Slopes(NamedTuple):
    """Derivatives with respect to distances from the lines [1/px], their cosine and the log spread, (n, p) each."""

    first: Array
    second: Array
    cosine: Array
    spread: Array


def _chain_slopes(sides: _Sides, slopes: _Slopes, free: int) -> Array:
    """Derivatives with respect to the first `free` of position, directions and spread, (n, free, p)."""
    (c1, c2), (s1, s2) = (np.split(each, 2, axis=1) for each in (sides.cosines, sides.sines))
    turned = slopes.cosine * sides.sine
    columns = (
        slopes.first * s1 + slopes.second * s2,
        -slopes.first * c1 - slopes.second * c2,
        -slopes.first * sides.along_first - turned,
        -slopes.second * sides.along_second + turned,
        slopes.spread,
    )
    return np.stack(columns[:free], axis=1)


def _overlap(sides: _Scaled) -> Array:
    """Bivariate normal distribution function minus the product of its marginals, (n, p).

    The derivative with respect to the correlation is the density (Price's theorem). The density is integrated by
    Gauss-Legendre quadrature over the arcsine of the correlation, in which it is smooth up to correlation one. Source:
    Drezner & Wesolowsky 1990.
    """
    product, squares = sides.first * sides.second, 0.5 * (sides.first**2 + sides.second**2)
    total = np.zeros_like(product)
    top = np.arcsin(np.clip(sides.cosine, -1, 1))
    for node, weight in zip(_NODES + 0.5, _WEIGHTS, strict=True):
        sine, cosine2 = np.sin(top * node), np.cos(top * node) ** 2
        total += weight * np.exp((sine * product - squares) / cosine2)
    return np.asarray(total * top / (2 * np.pi))
