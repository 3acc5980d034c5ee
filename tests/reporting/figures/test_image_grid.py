"""Squares of an image and what falls into them."""

from __future__ import annotations

import re

import numpy as np
import pytest

from basecal.reporting.figures.image_grid import image_grid


def test_points_fall_into_their_squares():
    """16 squares along the longer side; corners of the image are in the corner squares, the sums are theirs."""
    pixels = np.array([[-0.5, -0.5], [1279.4, 719.4], [1279.4, 700.0], [80.0, 0.0]])
    grid = image_grid((1280, 720), pixels)
    assert (grid.shape, grid.pitch) == ((16, 9), 80.0)
    assert grid.square.tolist() == [0, 143, 143, 1]
    assert grid.count[[0, 1, 143]].tolist() == [1, 1, 2]
    assert grid.count.sum() == 4
    assert grid.means(np.array([1.0, 2.0, 3.0, 4.0])).tolist() == [1.0, 4.0, 2.5]
    np.testing.assert_allclose(grid.middles[[0, 1, 143]], [[40, 40], [120, 40], [1240, 680]])


def test_an_image_that_is_not_whole_squares_has_a_last_row_of_less():
    """Of 1000 x 500 with squares of 62.5 all rows are there, and the last tile ends with the image."""
    grid = image_grid((1000, 510), np.array([[999.0, 509.0]]))
    assert grid.shape == (16, 9)
    drawn = grid.drawing("x", {9 * 16 - 1: (1.0, "last")}, ("0", "1"))
    assert re.findall(r'class="frame" x="0.0" y="0.0" width="640.0" height="([0-9.]+)"', drawn) == ["326.4"]
    assert re.findall(r'class="tile" x="600.0" y="([0-9.]+)" width="40.0" height="([0-9.]+)"', drawn) == [
        ("320.0", "6.4")
    ]


@pytest.mark.parametrize("pixels", [np.zeros((1, 2)), np.array([[0.0, 5.0], [100.0, 5.0]])])
def test_points_without_an_image_have_one(pixels):
    """A single point, or points on a line, have a frame with some height."""
    grid = image_grid(None, pixels)
    assert np.all(grid.size > 0)
    assert np.all((grid.square >= 0) & (grid.square < grid.shape[0] * grid.shape[1]))


def test_a_strip_says_how_large_the_image_is_and_what_shades_mean():
    """From the faintest to full, between their words, below the image."""
    grid = image_grid((1280, 720), np.array([[1.0, 2.0]]))
    strip = grid.drawing("x", {}, ("0", "0.5 px")).partition('height="360.0"')[2]
    shades = [float(shade) for shade in re.findall(r'fill-opacity="([0-9.]+)"', strip)]
    assert shades == sorted(shades)
    assert (shades[0], shades[-1]) == (0.12, 1.0)
    assert re.findall(r">([^<]+)</text>", strip) == ["1280 x 720 px", "0", "0.5 px"]
    assert min(float(y) for y in re.findall(r' y="([0-9.]+)"', strip)) > 360
