"""Tests of shapes fitted to patches of an image."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.vision.fit.corner_shapes import saddle, wedge
from basecal.vision.fit.ellipse import ellipse
from basecal.vision.fit.patch_fit import Patches, Shape, fit_shapes, pack_patches


@pytest.mark.parametrize(("shape", "size"), [(saddle, 6), (wedge, 6), (ellipse, 6)])
def test_fit_recovers_shapes_with_true_covariance(shape: Shape, size: int) -> None:
    """Fits of many patches with their own light recover the drawn shapes, each with its covariance."""
    rng = np.random.default_rng(2)
    xy = np.broadcast_to(np.stack(np.meshgrid(np.arange(-9, 10), np.arange(-9, 10)), -1).reshape(-1, 2), (20, 361, 2))
    first = [0, 0, np.log(5), 0, np.log(4), 0] if shape is ellipse else [0, 0, 0.2, -1.4, -0.2, 0.3]
    true = np.array(first) + rng.uniform(-0.1, 0.1, (20, size))
    values = 80 * shape(true, xy.astype(float)) + 50 + xy @ [0.3, -0.2]
    noise = rng.standard_normal(values.shape)
    patches = Patches(xy.astype(float), values + noise, np.ones_like(values))
    fit = fit_shapes(shape, true + rng.uniform(-0.2, 0.2, true.shape), patches, has_slope=True)
    assert fit.converged.all()
    error = fit.shape - true
    squared = np.einsum("ni,nij,nj->n", error, np.linalg.inv(fit.covariance), error)
    assert squared.mean() == pytest.approx(size, abs=3.5)  # chi-squared of 120 values: a sigma of the mean is 0.8


def test_held_parameters_are_unchanged() -> None:
    """The covariance is that of the other parameters."""
    xy = np.stack(np.meshgrid(np.arange(-9, 10), np.arange(-9, 10)), -1).reshape(1, -1, 2).astype(float)
    true = np.array([[0.1, -0.2, 0.2, -1.4, -0.2, 0.3]])
    start = true + np.array([0.2, 0.2, 0.1, 0.1, 0.3, 0.0])
    fit = fit_shapes(saddle, start, Patches(xy, 80 * saddle(true, xy) + 50, np.ones((1, 361))), held_count=1)
    assert fit.shape[0, 5] == start[0, 5]
    assert fit.covariance.shape == (1, 5, 5)
    np.testing.assert_allclose(fit.shape, true, atol=1e-3)
    np.testing.assert_allclose(fit.light, [[80, 50]], rtol=1e-3)


def test_loose_tolerance_ends_within_two_sigma() -> None:
    """A fit with a tolerance of a tenth ends near the optimum, within two sigmas of the pixels' noise."""
    rng = np.random.default_rng(5)
    xy = np.stack(np.meshgrid(np.arange(-6, 7), np.arange(-6, 7)), -1).reshape(1, -1, 2).astype(float)
    true = np.array([[0.1, -0.2, 0.2, -1.4, -0.2, 0.0]])
    patches = Patches(xy, 80 * saddle(true, xy) + 50 + rng.standard_normal((1, 169)), np.ones((1, 169)))
    start = true + np.array([1.0, -1.0, 0.2, 0.2, 0.3, 0.0])
    loose, tight = (fit_shapes(saddle, start, patches, held_count=1, tolerance=settled) for settled in (0.1, 1e-3))
    sigma = np.sqrt(np.diagonal(tight.covariance[0])[:2])
    assert np.all(np.abs(loose.shape[0, :2] - tight.shape[0, :2]) < 2 * sigma)
    assert not np.array_equal(loose.shape, tight.shape)


def test_packing_removes_pixels_without_weight() -> None:
    """Pixels without weight are removed, as far as all patches have some."""
    weights = np.array([[0, 1, 0, 2.0], [0, 0, 0, 3.0]])
    patches = Patches(np.arange(16.0).reshape(2, 4, 2), np.arange(8.0).reshape(2, 4), np.ones((2, 4)))
    kept = pack_patches(patches, weights)
    np.testing.assert_array_equal(kept.weights, [[1, 2], [3, 0]])
    np.testing.assert_array_equal(kept.values[:, 0], [1, 7])
    np.testing.assert_array_equal(kept.xy[0], [[2, 3], [6, 7]])
