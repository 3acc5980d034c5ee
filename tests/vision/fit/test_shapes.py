"""Ideal corners and outlines."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from basecal.geometry import Array
from basecal.vision.fit.patch_fit import Patches, Shape, fit_shapes
from basecal.vision.fit.shapes import ellipse, saddle, wedge

ANGLES = (0.5, 1.2, np.pi / 2, 2.4)


def corner(opening: float, sharpness: float = 0.0) -> Array:
    return np.array([[0.1, -0.2, 0.3, 0.3 - opening, np.log(0.8), sharpness]])


@pytest.mark.parametrize("opening", ANGLES)
def test_wedge_is_a_probability(opening: float) -> None:
    """A blurred corner is the chance that a place, moved by the point spread, is inside it."""
    q = corner(opening)
    xy = np.random.default_rng(0).normal(0, 1.2, (1, 40, 2))
    lines = [np.array([-np.sin(a), np.cos(a)]) for a in q[0, 2:4]]
    sides = np.stack([(xy[0] - q[0, :2]) @ normal / 0.8 for normal in lines], -1)
    between = lines[0] @ lines[1]
    expected = multivariate_normal([0, 0], [[1, between], [between, 1]]).cdf(sides)
    np.testing.assert_allclose(wedge(q, xy)[0], expected, atol=2e-5)


@pytest.mark.parametrize("opening", ANGLES)
def test_saddle_is_four_wedges(opening: float) -> None:
    """A chessboard's corner is the two dark wedges less the two bright ones, sharpened or not."""
    xy = np.random.default_rng(1).normal(0, 2, (1, 40, 2))
    for sharpness in (0.0, 1.5):
        q = corner(opening, sharpness)
        turned = [q + np.array([0, 0, a, b, 0, 0]) for a, b in ((0, 0), (np.pi, np.pi), (np.pi, 0), (0, np.pi))]
        one, two, three, four = (wedge(each, xy) for each in turned)
        np.testing.assert_allclose(saddle(q, xy), one + two - three - four, atol=1e-9)


def test_sharpening_overshoots() -> None:
    """A sharpened edge goes beyond the levels of both its sides, far from it is as before."""
    q = corner(np.pi / 2, sharpness=1.0)
    q[0, :4] = 0, 0, 0, -np.pi / 2
    across = np.stack([np.full(200, 30.0), np.linspace(-10, 10, 200)], -1)[None]
    profile = wedge(q, across)[0]
    assert profile.max() > 1.02
    assert profile.min() < -0.02
    np.testing.assert_allclose(profile[[0, -1]], [0, 1], atol=1e-9)


def test_ellipse_encloses_its_area() -> None:
    """An ellipse's values add up to the area of its outline, whatever its axes."""
    xy = np.stack(np.meshgrid(np.arange(-40, 41), np.arange(-40, 41)), -1).reshape(1, -1, 2).astype(float)
    q = np.array([[0.3, 0.1, np.log(15), 0.3, np.log(12), np.log(0.7)]])
    assert ellipse(q, xy).sum() == pytest.approx(np.pi * 15 * 12, rel=5e-3)


@pytest.mark.parametrize(("shape", "size"), [(saddle, 6), (wedge, 6), (ellipse, 6)])
def test_fit_finds_what_was_drawn(shape: Shape, size: int) -> None:
    """Fits of many pieces with their own light end at the shapes they were made of, each with its own covariance."""
    rng = np.random.default_rng(2)
    xy = np.broadcast_to(np.stack(np.meshgrid(np.arange(-9, 10), np.arange(-9, 10)), -1).reshape(-1, 2), (20, 361, 2))
    first = [0, 0, np.log(5), 0, np.log(4), 0] if shape is ellipse else [0, 0, 0.2, -1.4, -0.2, 0.3]
    true = np.array(first) + rng.uniform(-0.1, 0.1, (20, size))
    values = 80 * shape(true, xy.astype(float)) + 50 + xy @ [0.3, -0.2]
    noise = rng.standard_normal(values.shape)
    patches = Patches(xy.astype(float), values + noise, np.ones_like(values))
    fit = fit_shapes(shape, true + rng.uniform(-0.2, 0.2, true.shape), patches, sloped=True)
    assert fit.converged.all()
    error = fit.shape - true
    squared = np.einsum("ni,nij,nj->n", error, np.linalg.inv(fit.covariance), error)
    assert squared.mean() == pytest.approx(size, abs=3.5)  # chi-squared of 120 values: a sigma of the mean is 0.8
