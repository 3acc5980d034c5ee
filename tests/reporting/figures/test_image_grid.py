"""Tests of the grid of squares over an image, its coverage and lens uncertainty."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from tests.drawings import check_labels, labels, rectangles, view
from tests.seen_points import seen

from basecal.accuracy.residuals.lens_uncertainty import lens_sigmas
from basecal.fields.digits import two_digits
from basecal.geometry import Camera
from basecal.reporting.figures.image_grid import image_coverage, image_grid, lens_uncertainty
from basecal.reporting.svg import Figure

CAMERA = Camera("pinhole", np.array([900.0, 910.0, 630.0, 360.0, -0.1, 0.05, 1e-3, -1e-3, 0.01]), (1280, 720))
COVARIANCE = np.diag(np.array([1.0, 1.0, 2.0, 2.0, 2e-3, 3e-3, 1e-4, 1e-4, 3e-3]) ** 2)


@cache
def lens_map() -> Figure:
    """Uncertainty map of the lens."""
    figure = lens_uncertainty("wrist", CAMERA, COVARIANCE)
    assert figure is not None
    return figure


def test_points_are_assigned_to_squares():
    """The longer side has 16 squares.

    Points outside are in the nearest squares, and counts and means are those of the squares.
    """
    pixels = np.array([[-0.5, -0.5], [1279.4, 719.4], [1279.4, 700.0], [80.0, 0.0]])
    grid = image_grid((1280, 720), pixels)
    assert (grid.shape, grid.pitch) == ((16, 9), 80.0)
    assert grid.square.tolist() == [0, 143, 143, 1]
    outside = np.array([[-90.0, -90.0], [1400.0, 900.0], [1400.0, -90.0], [-90.0, 900.0]])
    assert image_grid((1280, 720), outside).square.tolist() == [0, 143, 15, 128]
    assert grid.count[[0, 1, 143]].tolist() == [1, 1, 2]
    assert grid.count.sum() == 4
    assert grid.means(np.array([1.0, 2.0, 3.0, 4.0])).tolist() == [1.0, 4.0, 2.5]
    np.testing.assert_allclose(grid.middles[[0, 1, 143]], [[40, 40], [120, 40], [1240, 680]])


def test_last_row_of_squares_is_cut():
    """An image of 1000 x 510 px with squares of 62.5 px has all rows, and the last tile ends with the image."""
    grid = image_grid((1000, 510), np.array([[999.0, 509.0]]))
    assert grid.shape == (16, 9)
    drawn = grid.drawing("x", {9 * 16 - 1: (1.0, "last")}, ("0", "1"))
    assert re.findall(r'class="frame" x="0.0" y="0.0" width="640.0" height="([0-9.]+)"', drawn) == ["326.4"]
    assert re.findall(r'class="tile" x="600.0" y="([0-9.]+)" width="40.0" height="([0-9.]+)"', drawn) == [
        ("320.0", "6.4")
    ]


@pytest.mark.parametrize("pixels", [np.zeros((1, 2)), np.array([[0.0, 5.0], [100.0, 5.0]])])
def test_unknown_image_size_has_positive_extent(pixels):
    """A single point, or points on a line, have a frame with a positive height."""
    grid = image_grid(None, pixels)
    assert np.all(grid.size > 0)
    assert np.all((grid.square >= 0) & (grid.square < grid.shape[0] * grid.shape[1]))


def test_strip_has_image_size_and_colour_bar():
    """The colour bar below the image ranges from the faintest to full, between its labels."""
    grid = image_grid((1280, 720), np.array([[1.0, 2.0]]))
    strip = grid.drawing("x", {}, ("0", "0.5 px")).partition('height="360.0"')[2]
    shades = [float(shade) for shade in re.findall(r'fill-opacity="([0-9.]+)"', strip)]
    assert shades == sorted(shades)
    assert (shades[0], shades[-1]) == (0.12, 1.0)
    assert re.findall(r">([^<]+)</text>", strip) == ["1280 x 720 px", "0", "0.5 px"]
    assert min(float(y) for y in re.findall(r' y="([0-9.]+)"', strip)) > 360


def test_coverage_counts_squares():
    """Two squares of 144 are covered, with three points and with one."""
    pixels = [[10.0, 10.0], [20.0, 10.0], [30.0, 10.0], [700.0, 500.0]]
    figure = image_coverage((1280, 720), seen(pixels, np.zeros((4, 2))))
    assert "in 2 of 144 squares (1 %), at most 3 in one" in figure.caption
    assert ">3 points<" in figure.svg
    assert ">1 point<" in figure.svg
    assert figure.svg.count('class="tile"') == 2


def test_lens_uncertainty_has_contours() -> None:
    """Each square is shaded from the smallest to the largest sigma, and contours have their values."""
    figure = lens_map()
    assert figure.title == "wrist, uncertainty of the lens"
    assert figure.svg.count('class="tile"') == 16 * 9
    assert 'fill-opacity="0.12"' in figure.svg
    assert 'fill-opacity="1.00"' in figure.svg
    assert figure.svg.count('class="contour-label"') >= 3


def test_lens_uncertainty_requires_image_size() -> None:
    """There is no map without an image size; the map of an exact lens has no contours."""
    assert lens_uncertainty("wrist", replace(CAMERA, size_px=None), COVARIANCE) is None
    exact = lens_uncertainty("wrist", CAMERA, 0 * COVARIANCE)
    assert exact is not None
    assert "contour" not in exact.svg


def test_contours_cover_the_image() -> None:
    """The image is drawn 640 wide and 360 high, without the strip below it."""
    figure = lens_map()
    (lines,) = re.findall(r'class="contour" d="([^"]*)"', figure.svg)
    places = np.array([float(number) for number in re.findall(r"[-0-9.]+", lines)]).reshape(-1, 2)
    assert places.min() >= 0
    assert np.all(places.max(0) <= [640, 360])
    assert np.all(np.ptp(places, axis=0) > [500, 250])


@pytest.mark.parametrize("size_px", [(1280, 720), (480, 640)])
def test_strip_is_readable(size_px):
    """The colour bar is between its labels, below the image, and its parts touch."""
    svg = image_grid(size_px, np.array([[1.0, 2.0]])).drawing("x", {}, ("0.05", "0.5 px"))
    check_labels(svg)
    size, low, high = labels(svg)
    bars, (frame,) = rectangles(svg, "tile shade"), rectangles(svg, "frame")
    assert len(bars) == 8
    assert size.right < low.left
    assert low.right < bars[0].left < low.right + 12
    assert bars[-1].right < high.left < bars[-1].right + 12
    np.testing.assert_allclose([box.left for box in bars[1:]], [box.right for box in bars[:-1]], atol=0.11)
    assert bars[-1].right - bars[0].left == 160
    for box in (*bars, size, low, high):
        assert frame.bottom <= box.top
        assert box.bottom <= view(svg).bottom
    assert size.left == frame.left == 0
    np.testing.assert_allclose(frame.bottom, 640 * size_px[1] / size_px[0], atol=0.06)


def test_unknown_image_is_bounding_box_of_points():
    """The box is enlarged by 5 % on each side, and is at least an eighth as high as wide."""
    grid = image_grid(None, np.array([[100.0, 50.0], [300.0, 150.0]]))
    np.testing.assert_allclose([grid.low, grid.size], [[90, 45], [220, 110]])
    line = image_grid(None, np.array([[0.0, 5.0], [160.0, 5.0]]))
    np.testing.assert_allclose(line.size, [176, 22])
    np.testing.assert_allclose(image_grid(None, np.zeros((1, 2))).size, [0.1375, 0.1375])


def test_tiles_are_at_their_squares():
    """A point is inside of the tile of its square, in the scale of the drawing."""
    pixels = np.array([[10.0, 10.0], [700.0, 500.0], [1270.0, 30.0]])
    boxes = rectangles(image_coverage((1280, 720), seen(pixels, np.zeros((3, 2)))).svg, "tile")
    assert len(boxes) == 3
    for x, y in (pixels + 0.5) / 2:
        assert sum(box.left <= x <= box.right and box.top <= y <= box.bottom for box in boxes) == 1
    assert {(round(box.right - box.left), round(box.bottom - box.top)) for box in boxes} == {(40, 40)}


def test_coverage_shades_are_square_roots():
    """A square with one point is half as dark as one with four. The caption's share is that of all squares."""
    pixels = [[10.0, 10.0]] * 4 + [[700.0, 500.0]]
    figure = image_coverage((1280, 720), seen(pixels, np.zeros((5, 2))))
    assert [box.text for box in rectangles(figure.svg, "tile")] == ["1.00", "0.56"]
    assert [label.text for label in labels(figure.svg)][1:] == ["1 point", "4"]


def test_lens_colour_bar_has_extreme_sigmas():
    """The faintest and the darkest square are the ends of the colour bar."""
    figure = lens_map()
    words = [float(each) for each in re.findall(r"1 sigma ([0-9.]+) px", figure.svg)]
    _, low, high = (label.text for label in labels(figure.svg) if label.top > 360)
    assert (f"{min(words):g}", f"{max(words):g} px") == (f"{float(low):g}", f"{float(high[:-3]):g} px")
    shades = [float(box.text) for box in rectangles(figure.svg, "tile")]
    assert words[int(np.argmax(shades))] == max(words)
    assert words[int(np.argmin(shades))] <= 1.1 * min(words)


def test_lens_shades_are_sigmas_at_square_centres() -> None:
    """The scale ranges from the smallest to the largest sigma, with a margin of 6 % on both sides."""
    figure = lens_map()
    words = re.findall(r"1 sigma ([0-9.]+) px", figure.svg)
    places = np.stack(np.meshgrid(80 * np.arange(16) + 39.5, 80 * np.arange(9) + 39.5), -1).reshape(-1, 2)
    assert words == [two_digits(float(sigma)) for sigma in lens_sigmas(CAMERA, COVARIANCE, places)]
    shades = [float(box.text) for box in rectangles(figure.svg, "tile")]
    assert (min(shades), max(shades)) == (
        pytest.approx(0.12 + 0.88 * 0.06 / 1.12, abs=0.006),
        pytest.approx(0.12 + 0.88 * 1.06 / 1.12, abs=0.006),
    )
    assert len(set(shades)) > 20


def test_tiny_lens_sigmas_have_one_shade() -> None:
    """Sigmas below a millionth of a pixel have one shade."""
    figure = lens_uncertainty("wrist", CAMERA, 1e-20 * COVARIANCE)
    assert len({box.text for box in rectangles(figure.svg, "tile")}) == 1


def test_squares_begin_at_border_of_first_pixel() -> None:
    """The grid begins half a pixel before the centre of the first pixel, along both axes."""
    pixels = np.array([[79.4, 10.0], [79.6, 10.0], [10.0, 79.4], [10.0, 79.6]])
    assert image_grid((1280, 720), pixels).square.tolist() == [0, 1, 0, 16]


def test_narrow_image_has_one_row() -> None:
    """An image has at least one row and one column of squares."""
    assert image_grid((1600, 1), np.zeros((1, 2))).shape == (16, 1)
    assert image_grid((1, 1600), np.zeros((1, 2))).shape == (1, 16)
    assert image_grid((1600, 102), np.zeros((1, 2))).shape == (16, 2)
