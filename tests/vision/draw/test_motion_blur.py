"""Tests of motion blur along a line."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.vision.draw.motion_blur import blur_motion


@pytest.mark.parametrize("way", [(6.0, 0.0), (0.0, 4.5), (3.0, -5.0)])
def test_point_becomes_a_line(way):
    """The sum and the centroid of the levels are unchanged.

    The levels spread as a line of the motion's length: variance L^2 / 12.
    """
    image = np.zeros((41, 41))
    image[20, 20] = 100.0
    out = blur_motion(image, np.array(way))
    v, u = np.mgrid[:41, :41]
    weights = out / out.sum()
    assert out.sum() == pytest.approx(100.0)
    assert (weights * u).sum() == pytest.approx(20.0, abs=0.01)
    along = ((u - 20) * way[0] + (v - 20) * way[1]) / np.hypot(*way)
    # The distribution over neighbouring pixels adds up to a quarter.
    assert (weights * along**2).sum() == pytest.approx(np.hypot(*way) ** 2 / 12, abs=0.3)


def test_negligible_motion_changes_nothing():
    """A motion below a fiftieth of a pixel returns the same array."""
    image = np.arange(12.0).reshape(3, 4)
    assert blur_motion(image, np.array([0.01, 0.0])) is image


@pytest.mark.parametrize("way", [(6.0, 0.0), (0.0, -4.5), (3.0, -5.0), (0.5, 0.2)])
def test_motion_blur_is_symmetric(way):
    """The blur is the same for the opposite motion, and a uniform image is unchanged. No level is far from the line."""
    image = np.zeros((41, 41))
    image[20, 20] = 100.0
    out = blur_motion(image, np.array(way))
    np.testing.assert_allclose(out, out[::-1, ::-1], atol=1e-12)
    np.testing.assert_allclose(out, blur_motion(image, -np.array(way)), atol=1e-12)
    v, u = np.nonzero(out > 1e-9)
    assert np.abs(u - 20).max() <= abs(way[0]) / 2 + 1
    assert np.abs(v - 20).max() <= abs(way[1]) / 2 + 1
    np.testing.assert_allclose(blur_motion(np.full((9, 9), 7.0), np.array(way)), 7.0)


def test_motion_blur_is_uniform_along_the_line():
    """A motion of twelve pixels along a row gives a twelfth to each pixel, and less at the ends."""
    image = np.zeros((5, 41))
    image[2, 20] = 1.0
    out = blur_motion(image, np.array([12.0, 0.0]))
    np.testing.assert_allclose(out[2, 15:26], 1 / 12, rtol=0.1)
    np.testing.assert_allclose(out[2, [14, 26]], 0.5 / 12, rtol=0.1)
    assert out[[0, 1, 3, 4]].max() < 1e-12


def test_motion_blur_has_maximal_length():
    """The line is limited to 400 px in the direction of the motion."""
    image = np.zeros((9, 901))
    image[4, 450] = 1.0
    out = blur_motion(image, np.array([800.0, 0.0]))
    assert out.sum() == pytest.approx(1.0)
    columns = np.nonzero(out[4] > 1e-9)[0]
    assert (columns.min(), columns.max()) == (pytest.approx(250, abs=2), pytest.approx(650, abs=2))


def test_motion_above_threshold_blurs():
    """A motion of a fiftieth of a pixel or more blurs the image."""
    image = np.arange(12.0).reshape(3, 4)
    assert blur_motion(image, np.array([0.0, 0.019])) is image
    assert blur_motion(image, np.array([0.015, 0.015])) is not image
