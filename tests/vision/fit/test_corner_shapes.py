"""Tests of the models of ideal corners."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from basecal.geometry import Array
from basecal.vision.fit.corner_shapes import Corner, saddle, wedge
from derivatives import check_derivative

ANGLES = (0.5, 1.2, np.pi / 2, 2.4)


def corner(opening: float, sharpness: float = 0.0) -> Array:
    return np.array([[0.1, -0.2, 0.3, 0.3 - opening, np.log(0.8), sharpness]])


@pytest.mark.parametrize("opening", ANGLES)
def test_wedge_is_a_bivariate_probability(opening: float) -> None:
    """A blurred corner is the probability that a point, displaced by the point spread, is inside of it."""
    q = corner(opening)
    xy = np.random.default_rng(0).normal(0, 1.2, (1, 40, 2))
    lines = [np.array([-np.sin(a), np.cos(a)]) for a in q[0, 2:4]]
    sides = np.stack([(xy[0] - q[0, :2]) @ normal / 0.8 for normal in lines], -1)
    between = lines[0] @ lines[1]
    expected = multivariate_normal([0, 0], [[1, between], [between, 1]]).cdf(sides)
    np.testing.assert_allclose(wedge(q, xy)[0], expected, atol=2e-5)


@pytest.mark.parametrize("opening", ANGLES)
def test_saddle_is_sum_of_four_wedges(opening: float) -> None:
    """A chessboard's corner is the two dark wedges less the two bright ones, sharpened or not."""
    xy = np.random.default_rng(1).normal(0, 2, (1, 40, 2))
    for sharpness in (0.0, 1.5):
        q = corner(opening, sharpness)
        turned = [q + np.array([0, 0, a, b, 0, 0]) for a, b in ((0, 0), (np.pi, np.pi), (np.pi, 0), (0, np.pi))]
        one, two, three, four = (wedge(each, xy) for each in turned)
        np.testing.assert_allclose(saddle(q, xy), one + two - three - four, atol=1e-9)


def test_sharpening_overshoots() -> None:
    """A sharpened edge exceeds the levels of both its sides, and is unchanged far from it."""
    q = corner(np.pi / 2, sharpness=1.0)
    q[0, :4] = 0, 0, 0, -np.pi / 2
    across = np.stack([np.full(200, 30.0), np.linspace(-10, 10, 200)], -1)[None]
    profile = wedge(q, across)[0]
    assert profile.max() > 1.02
    assert profile.min() < -0.02
    np.testing.assert_allclose(profile[[0, -1]], [0, 1], atol=1e-9)


@pytest.mark.parametrize("shape", [saddle, wedge], ids=["saddle", "wedge"])
@pytest.mark.parametrize("opening", ANGLES)
@pytest.mark.parametrize("sharpness", [0.0, 0.7, -0.3])
def test_corner_derivatives_match_differences(shape: Corner, opening: float, sharpness: float) -> None:
    """Derivatives with respect to all six parameters, or the first of them, match those of the values."""
    q = corner(opening, sharpness)
    xy = np.random.default_rng(3).normal(0, 2, (1, 40, 2))
    for free in (2, 4, 5, 6):
        values, derivatives = shape.linearise_shape(q, xy, free)
        np.testing.assert_allclose(values, shape(q, xy), atol=1e-12)

        def moved(step: Array, free: int = free) -> Array:
            return shape(q + np.pad(step, (0, 6 - free)), xy)[0]

        # Sharp corners have a larger second derivative than other functions.
        check_derivative(moved, np.moveaxis(derivatives[0], 0, -1), step=3e-3, tolerance=3e-3 if opening < 1 else 1e-4)


def test_parallel_lines_give_finite_derivatives() -> None:
    """Two coincident lines are no corner, but no value or derivative overflows."""
    xy = np.random.default_rng(4).normal(0, 2, (1, 40, 2))
    for turn in (0.0, np.pi):
        q = np.array([[0.0, 0.0, 0.3, 0.3 + turn, np.log(0.8), 0.0]])
        for shape in (saddle, wedge):
            assert all(np.isfinite(each).all() for each in shape.linearise_shape(q, xy, 6))


def test_spread_is_bounded() -> None:
    """Beyond 55 px the values are independent of the spread, and the derivative is zero."""
    xy = np.random.default_rng(5).normal(0, 2, (1, 40, 2))
    q = corner(np.pi / 2)
    q[0, 4] = 800.0
    values, derivatives = saddle.linearise_shape(q, xy, 5)
    assert np.isfinite(derivatives).all()
    np.testing.assert_array_equal(values, saddle(q - [0, 0, 0, 0, 100.0, 0], xy))
    assert not derivatives[0, 4].any()
