"""Tests of the model of images of discs."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.special import ndtr

from basecal.geometry import Array
from basecal.vision.fit.ellipse import ellipse
from derivatives import check_derivative


def test_ellipse_values_add_up_to_area() -> None:
    """The values of an ellipse add up to the area of its outline, for any axes."""
    xy = np.stack(np.meshgrid(np.arange(-40, 41), np.arange(-40, 41)), -1).reshape(1, -1, 2).astype(float)
    q = np.array([[0.3, 0.1, np.log(15), 0.3, np.log(12), np.log(0.7)]])
    assert ellipse(q, xy).sum() == pytest.approx(np.pi * 15 * 12, rel=5e-3)


def test_ellipse_derivatives_match_differences() -> None:
    """Derivatives match those of the values, within the accuracy of finite differences."""
    q = np.array([[0.3, 0.1, np.log(6), 0.2, np.log(5), np.log(0.7)]])
    xy = np.random.default_rng(0).normal(0, 4, (1, 60, 2))
    _, derivatives = ellipse.linearise_shape(q, xy, 6)

    def moved(step: Array) -> Array:
        return ellipse(q + step, xy)[0]

    check_derivative(moved, np.moveaxis(derivatives[0], 0, -1), step=3e-3, tolerance=1e-4)


def test_ellipse_values_follow_blurred_edge() -> None:
    """The values of a disc of 8 px with a blur of 0.7 px depend on the distance to the edge.

    At the centre they are one, with derivatives.
    """
    q = np.array([[0.3, 0.1, np.log(8), 0.0, np.log(8), np.log(0.7)]])
    radii = np.array([0.0, 2.0, 7.3, 8.0, 8.7, 12.0])
    xy = np.stack([0.3 + 0.6 * radii, 0.1 + 0.8 * radii], axis=-1)[None]
    np.testing.assert_allclose(ellipse(q, xy)[0], ndtr((8 - radii) / 0.7), atol=1e-12)
    shares, derivatives = ellipse.linearise_shape(q, xy, 6)
    np.testing.assert_array_equal(shares, ellipse(q, xy))
    assert np.all(np.isfinite(derivatives))
    assert not derivatives[0, :, 0].any()
    edge = np.exp(-0.5) / np.sqrt(2 * np.pi) / 0.7
    np.testing.assert_allclose(derivatives[0, :2, 2], edge * np.array([0.6, 0.8]), rtol=1e-9)
    np.testing.assert_allclose(derivatives[0, 5, 2], -edge * 0.7, rtol=1e-9)


def test_outline_is_image_of_unit_circle() -> None:
    """The outline, where the level is one half, is the unit circle mapped by the exponential of a symmetric matrix."""
    generator = np.array([[1.2, 0.5], [0.5, 2.0]])
    turn = np.linspace(0, 6, 20)
    outline = np.stack([np.cos(turn), np.sin(turn)], axis=-1) @ expm(generator)
    q = np.array([[3.0, -2.0, 1.2, 0.5, 2.0, 0.0]])
    np.testing.assert_allclose(ellipse(q, outline[None] + [3.0, -2.0]), 0.5, atol=1e-12)


@pytest.mark.parametrize("free", [2, 5, 6])
def test_only_free_parameters_have_derivatives(free: int) -> None:
    """The derivatives of the first parameters equal those of all."""
    q = np.array([[0.3, 0.1, np.log(6), 0.2, np.log(5), np.log(0.7)]])
    xy = np.random.default_rng(0).normal(0, 4, (1, 9, 2))
    every = ellipse.linearise_shape(q, xy, 6)[1]
    np.testing.assert_array_equal(ellipse.linearise_shape(q, xy, free)[1], every[:, :free])


def test_extreme_parameters_stay_finite() -> None:
    """Beyond 55 px the point spread is that of 55 px, and no longer depends on its parameter."""
    xy = np.random.default_rng(0).normal(0, 4, (1, 9, 2))
    disc = [0.0, 0.0, np.log(6), 0.0, np.log(6)]
    at_most = ellipse(np.array([[*disc, 4.0]]), xy)
    np.testing.assert_array_equal(ellipse(np.array([[*disc, 4.5]]), xy), at_most)
    assert np.abs(ellipse(np.array([[*disc, 3.9]]), xy) - at_most).max() > 1e-4
    _, derivatives = ellipse.linearise_shape(
        np.array([[*disc, 4.5], [*disc, 3.9], [*disc, -4.5]]), np.repeat(xy, 3, 0), 6
    )
    assert derivatives[:, 5].any(axis=1).tolist() == [False, True, False]
    for sign in (-1, 1):
        far = np.array([[1e6 * sign, 0.0, 1e3 * sign, 1e3, -1e3 * sign, 1e3 * sign]])
        assert np.all(np.isfinite(ellipse.linearise_shape(far, xy, 6)[0]))
