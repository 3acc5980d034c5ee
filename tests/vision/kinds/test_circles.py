"""Grids of circles in images that are not as they should be."""

from __future__ import annotations

import time

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from basecal.cell.targets.circles import circles_target
from basecal.geometry import SE3, Array
from basecal.vision.draw.render import RenderSettings, render
from basecal.vision.kinds.circles import detect, has_further_row
from vision_scenes import DARK, TARGETS, WIDE, at, check_poor_image, errors_of, scene, shrunk

SHAPE = TARGETS["circles"]
POOR = {
    "as they should be": (RenderSettings(), 1, 40),
    "dark": (DARK, 1, 40),
    "blurred": (RenderSettings(blur_px=6.0, noise=1.0), 1, 40),
    "small": (RenderSettings(), 5, 40),
}
GRID_SHAPE = TARGETS["circles"]
IMAGE = scene(GRID_SHAPE)


@pytest.mark.parametrize("how", list(POOR))
def test_poor_images(how: str) -> None:
    """Found where dark, blurred or small, with sigmas true within a factor of two and a half."""
    check_poor_image(detect, SHAPE, *POOR[how])


@pytest.mark.parametrize("bits", [8, 16])
def test_bright_circles(bits: int) -> None:
    """Bright discs on dark paper are found where dark ones are on bright paper, with the same sigmas."""
    image = scene(SHAPE, RenderSettings(bits=bits))
    dark, bright = detect(image, SHAPE), detect(np.iinfo(image.dtype).max - image, SHAPE)
    assert dark is not None
    assert bright is not None
    np.testing.assert_allclose(bright.pixels, dark.pixels, atol=1e-3)
    np.testing.assert_allclose(bright.sigma_px, dark.sigma_px, rtol=1e-2)


def test_sigmas_are_true() -> None:
    """Of 160 coordinates, to a tenth."""
    images = [render(WIDE, SHAPE, at(SHAPE), RenderSettings(), seed) for seed in range(2)]
    found = [detect(image, SHAPE) for image in images]
    squares = [(errors_of(each, SHAPE) / each.sigma_px[:, None]) ** 2 for each in found]
    assert np.sqrt(np.mean(squares)) == pytest.approx(1, abs=0.1)


def test_noise_of_many_blobs_ends_soon() -> None:
    """In an image of thousands of specks the search for a grid ends, and nothing is found."""
    specks = np.random.default_rng(0).normal(0, 1, (480, 640))
    image = np.clip(128 + 400 * gaussian_filter(specks, 2.0), 0, 255).astype(np.uint8)
    began = time.perf_counter()
    assert detect(image, SHAPE) is None
    assert time.perf_counter() - began < 20  # one second; unbounded, minutes


@pytest.mark.parametrize(("circles", "asymmetric"), [((5, 7), True), ((4, 4), False)])
@pytest.mark.parametrize("blur_px", [0.0, 2.0])
def test_squares_of_a_chessboard_are_no_discs(circles: tuple[int, int], asymmetric: bool, blur_px: float) -> None:
    """OpenCV finds such grids among its dark squares, sharp or blurred; what ellipses leave of them tells."""
    image = scene(TARGETS["chessboard"])
    blurred = gaussian_filter(image.astype(np.float64), blur_px) if blur_px else image
    assert detect(blurred.astype(np.uint8), circles_target(circles, 0.02, asymmetric)) is None


def grid() -> Array:
    return WIDE.project(at(GRID_SHAPE) @ GRID_SHAPE.points).reshape(5, 8, 2)


def test_the_whole_grid_ends() -> None:
    """A grid that was found whole goes on nowhere, whichever way it is read."""
    for whole in (grid(), grid()[::-1], grid()[:, ::-1], grid().swapaxes(0, 1)):
        assert not has_further_row(IMAGE, whole)


@pytest.mark.parametrize("part", [np.s_[1:], np.s_[:-1], np.s_[:, 1:], np.s_[:, :-1], np.s_[1:4, 2:6]])
def test_a_part_goes_on(part: object) -> None:
    """Without a row or column on any side, the grid goes on there."""
    assert has_further_row(IMAGE, grid()[part])


def test_rows_beyond_the_image_do_not_count() -> None:
    """Where the next row would be outside the image, nothing is known of it."""
    upright = SE3(np.eye(3), np.array([0.0, 0.0, 0.5]))
    places = WIDE.project(at(GRID_SHAPE, upright) @ GRID_SHAPE.points).reshape(5, 8, 2)
    image = scene(GRID_SHAPE, pose=upright)
    assert has_further_row(image, places[:, :-1])
    assert not has_further_row(image[:, : int(places[:, -2, 0].max()) + 8], places[:, :-1])


@pytest.mark.parametrize("size", [(7, 5), (8, 4), (4, 4)])
def test_fewer_circles_than_printed_are_none(size: tuple[int, int]) -> None:
    """A target stated with fewer circles than it has is not found: which of them were seen would change."""
    image = shrunk(IMAGE, 2)
    assert detect(image, SHAPE) is not None
    assert detect(image, circles_target(size, 0.03)) is None
