"""Grids of circles in images that are not as they should be."""

from __future__ import annotations

import time

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from basecal.cell.targets.circles import circles_target
from basecal.geometry import SE3, Array
from basecal.vision.draw.render import RenderSettings, render
from basecal.vision.kinds.circles import _eccentricity, detect, has_further_row
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


def offset_of_centre(bend: Array, tilt: tuple[float, float]) -> tuple[Array, Array]:
    """Stated and true offset of the ellipse of a disc from the image of its centre, in the middle of a grid [px].

    The image bends by second derivatives xx, xy and yy, (3, 2) [px per pitch^2], and has a perspective.
    """
    places = np.stack(np.meshgrid(np.arange(7.0) - 3, np.arange(7.0) - 3), -1).reshape(-1, 2)
    turn = np.linspace(0, 2 * np.pi, 64, endpoint=False)
    ring = np.stack([np.cos(turn), np.sin(turn)], -1)

    def image(xy: Array) -> Array:
        x, y = xy.T
        return 40 * xy / (1 + xy @ tilt)[:, None] + np.stack([x * x / 2, x * y, y * y / 2], -1) @ bend

    shapes = np.tile([0.0, 0.0, np.log(12.0), 0.0, np.log(12.0), 0.0], (49, 1))
    shapes[:, :2] = image(places)
    stated = sum(each[24] for each in _eccentricity(0.03 * places, shapes, 0.03))
    outline = image(0.3 * ring) - shapes[24, :2]
    return stated, 2 * np.mean((outline * ring).sum(axis=1)[:, None] * ring, axis=0)


@pytest.mark.parametrize("row", [0, 1, 2])
@pytest.mark.parametrize("axis", [0, 1])
def test_centres_of_ellipses_are_off_by_bends(row: int, axis: int) -> None:
    """Each second derivative shifts the outline's centre by what a fit of the outline finds."""
    bend = np.zeros((3, 2))
    bend[row, axis] = 1.0
    np.testing.assert_allclose(*offset_of_centre(bend, (0.0, 0.0)), atol=1e-4)


def test_centres_of_ellipses_are_off_by_perspective() -> None:
    """Alone, and together with all bends."""
    np.testing.assert_allclose(*offset_of_centre(np.zeros((3, 2)), (0.02, 0.01)), atol=1e-5)
    every = np.array([[0.5, 0.3], [0.2, -0.4], [0.1, 0.6]])
    np.testing.assert_allclose(*offset_of_centre(every, (0.02, 0.01)), atol=1e-3)


def test_bright_circles_on_black_paper() -> None:
    """All discs are found, although the level of the paper is zero."""
    found = detect(scene(SHAPE, RenderSettings(black=200.0, white=0.0, background=0.0, noise=1.0)), SHAPE)
    assert found is not None
    assert len(found.pixels) == 40
