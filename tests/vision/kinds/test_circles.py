"""Tests of the detection of grids of circles."""

from __future__ import annotations

import time

import cv2
import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from basecal.cell.targets.circles import circles_target
from basecal.geometry import SE3, Array
from basecal.vision.draw.render import RenderSettings, render
from basecal.vision.fit.patch_fit import Patches
from basecal.vision.kinds import circles
from basecal.vision.kinds.circles import (
    _eccentricity,
    _fit_outlines,
    _has_discs,
    _levels,
    _Outlines,
    _shared_residual,
    detect,
    has_further_row,
)
from vision_scenes import DARK, SMALL, TARGETS, WIDE, at, check_poor_image, errors_of, scene, shrunk

SHAPE = TARGETS["circles"]
POOR = {
    "as they should be": (RenderSettings(), 1, 40),
    "dark": (DARK, 1, 40),
    "blurred": (RenderSettings(blur_px=6.0, noise=1.0), 1, 40),
    "small": (RenderSettings(), 5, 40),
}
GRID_SHAPE = TARGETS["circles"]
IMAGE = scene(GRID_SHAPE)


@pytest.mark.journey
@pytest.mark.parametrize("how", list(POOR))
def test_circles_are_detected_in_poor_images(how: str) -> None:
    """Dark, blurred or small grids are detected, with sigmas true within a factor of two and a half."""
    check_poor_image(detect, SHAPE, *POOR[how])


@pytest.mark.journey
@pytest.mark.parametrize("bits", [8, 16])
def test_bright_circles_are_detected(bits: int) -> None:
    """Bright discs on dark paper are detected like dark ones on bright paper, with the same sigmas."""
    image = scene(SHAPE, RenderSettings(bits=bits))
    dark, bright = detect(image, SHAPE), detect(np.iinfo(image.dtype).max - image, SHAPE)
    assert dark is not None
    assert bright is not None
    np.testing.assert_allclose(bright.pixels, dark.pixels, atol=1e-3)
    np.testing.assert_allclose(bright.sigma_px, dark.sigma_px, rtol=1e-2)


@pytest.mark.parametrize("circles", [(4, 6), (5, 6), (4, 11)])
@pytest.mark.parametrize("turn_deg", [0, 60, 180, 270])
def test_asymmetric_grid_is_detected_at_any_rotation(circles: tuple[int, int], turn_deg: float) -> None:
    """Each disc has its own id and pixel, counted from either end if the number of rows is even."""
    shape = circles_target(circles, 0.02, asymmetric=True)
    pose = at(shape, SE3.from_rpy((0.2, 0.1, np.radians(turn_deg)), (0.0, 0.0, 0.5)))
    found = detect(render(WIDE, shape, pose), shape)
    assert found is not None
    assert len(found.pixels) == len(shape.ids)
    true = WIDE.project(pose @ shape.points)
    ends = (true, true[::-1]) if circles[1] % 2 == 0 else (true,)
    assert min(np.abs(found.pixels - each).max() for each in ends) < 0.05


@pytest.mark.journey
def test_mirrored_grid_is_not_detected() -> None:
    """The mirror image of an asymmetric grid with an even number of rows is another grid."""
    shape = circles_target((4, 6), 0.02, asymmetric=True)
    assert detect(scene(shape), shape) is not None
    assert detect(np.fliplr(scene(shape)), shape) is None


@pytest.mark.journey
def test_circle_sigmas_match_errors() -> None:
    """The sigmas of 160 coordinates agree with the errors within a tenth."""
    images = [render(WIDE, SHAPE, at(SHAPE), RenderSettings(), seed) for seed in range(2)]
    found = [detect(image, SHAPE) for image in images]
    squares = [(errors_of(each, SHAPE) / each.sigma_px[:, None]) ** 2 for each in found]
    assert np.sqrt(np.mean(squares)) == pytest.approx(1, abs=0.1)


@pytest.mark.journey
def test_search_in_many_blobs_is_bounded() -> None:
    """The search for a grid among thousands of specks ends, and no grid is detected."""
    specks = np.random.default_rng(0).normal(0, 1, (480, 640))
    image = np.clip(128 + 400 * gaussian_filter(specks, 2.0), 0, 255).astype(np.uint8)
    began = time.perf_counter()
    assert detect(image, SHAPE) is None
    assert time.perf_counter() - began < 20  # one second; unbounded, minutes


@pytest.mark.journey
@pytest.mark.parametrize(("circles", "asymmetric"), [((5, 7), True), ((4, 4), False)])
@pytest.mark.parametrize("blur_px", [0.0, 2.0])
def test_chessboard_is_not_a_grid_of_circles(circles: tuple[int, int], asymmetric: bool, blur_px: float) -> None:
    """OpenCV finds such grids among its dark squares, sharp or blurred. The residuals of the ellipses exclude them."""
    image = scene(TARGETS["chessboard"])
    blurred = gaussian_filter(image.astype(np.float64), blur_px) if blur_px else image
    assert detect(blurred.astype(np.uint8), circles_target(circles, 0.02, asymmetric)) is None


def grid() -> Array:
    return WIDE.project(at(GRID_SHAPE) @ GRID_SHAPE.points).reshape(5, 8, 2)


def test_complete_grid_has_no_further_row() -> None:
    """A completely detected grid has no further row, in any reading order."""
    for whole in (grid(), grid()[::-1], grid()[:, ::-1], grid().swapaxes(0, 1)):
        assert not has_further_row(IMAGE, whole)


@pytest.mark.parametrize("part", [np.s_[1:], np.s_[:-1], np.s_[:, 1:], np.s_[:, :-1], np.s_[1:4, 2:6]])
def test_partial_grid_has_a_further_row(part: object) -> None:
    """A grid that lacks a row or column on any side has a further row there."""
    assert has_further_row(IMAGE, grid()[part])


def test_row_outside_of_image_is_ignored() -> None:
    """A row that would be outside of the image cannot be checked."""
    upright = SE3(np.eye(3), np.array([0.0, 0.0, 0.5]))
    places = WIDE.project(at(GRID_SHAPE, upright) @ GRID_SHAPE.points).reshape(5, 8, 2)
    image = scene(GRID_SHAPE, pose=upright)
    assert has_further_row(image, places[:, :-1])
    assert not has_further_row(image[:, : int(places[:, -2, 0].max()) + 8], places[:, :-1])


@pytest.mark.parametrize("size", [(7, 5), (8, 4), (4, 4)])
def test_grid_larger_than_stated_is_not_detected(size: tuple[int, int]) -> None:
    """A grid with more circles than stated is not detected, since it would be ambiguous which of them were observed."""
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
def test_ellipse_centre_bias_by_second_derivatives(row: int, axis: int) -> None:
    """Each second derivative shifts the centre of the outline as a fit of the outline does."""
    bend = np.zeros((3, 2))
    bend[row, axis] = 1.0
    np.testing.assert_allclose(*offset_of_centre(bend, (0.0, 0.0)), atol=1e-4)


def test_ellipse_centre_bias_by_perspective() -> None:
    """Perspective shifts the centre of the outline, alone and together with all second derivatives."""
    np.testing.assert_allclose(*offset_of_centre(np.zeros((3, 2)), (0.02, 0.01)), atol=1e-5)
    every = np.array([[0.5, 0.3], [0.2, -0.4], [0.1, 0.6]])
    np.testing.assert_allclose(*offset_of_centre(every, (0.02, 0.01)), atol=1e-3)


def test_bright_circles_on_black_paper_are_detected() -> None:
    """All discs are detected, although the level of the paper is zero."""
    found = detect(scene(SHAPE, RenderSettings(black=200.0, white=0.0, background=0.0, noise=1.0)), SHAPE)
    assert found is not None
    assert len(found.pixels) == 40


def patches(weights: Array) -> Patches:
    return Patches(np.zeros((*weights.shape, 2)), np.zeros(weights.shape), weights)


def test_shared_residual_is_that_of_neighbours() -> None:
    """Equal residuals count fully, and alternating ones and those beside unused pixels not at all."""
    residuals = np.array([[2.0, 2, 2, 2], [2, -2, 2, -2], [2, 9, 2, 2], [2, 9, 2, 9]])
    weights = np.array([[1.0, 1, 1, 1], [1, 1, 1, 1], [1, 0, 1, 1], [1, 0, 1, 0]])
    np.testing.assert_allclose(_shared_residual(patches(weights), residuals), [2, 0, 2, 0])
    np.testing.assert_allclose(_shared_residual(patches(0.5 * weights[:1]), np.array([[3.0, 3, 0, 0]])), [3**0.5])


def test_levels_are_those_of_the_nearest_pixel() -> None:
    """Positions outside of the image have the levels of its border."""
    image = np.arange(12, dtype=np.uint8).reshape(3, 4)
    places = np.array([[0.4, 0.6], [-3.0, 1.0], [2.0, -1.0], [9.0, 1.0], [1.0, 7.0]])
    assert _levels(image, places).tolist() == [4, 4, 2, 7, 9]


def discs(columns: int, rows: int, lacking: int = 0) -> tuple[np.ndarray, Array]:
    """Image of discs 20 px apart with some missing in its first row, and the centres of the other rows."""
    image = np.full((20 * rows, 20 * columns), 220, np.uint8)
    centres = np.stack(np.meshgrid(20 * np.arange(columns) + 10, 20 * np.arange(rows) + 10), -1)
    for row, column in np.ndindex(rows, columns):
        if row or column >= lacking:
            cv2.circle(image, tuple(map(int, centres[row, column])), 6, 30, -1)
    return image, centres[1:].astype(float)


@pytest.mark.parametrize(("lacking", "further"), [(0, True), (1, True), (2, False)])
def test_one_disc_of_further_row_may_be_missing(lacking: int, further: bool) -> None:
    """One of five discs may be missing, on any side of the grid."""
    image, centres = discs(5, 4, lacking)
    assert has_further_row(image, centres) == further
    assert has_further_row(image[::-1], [0, 79] + [1, -1] * centres) == further
    assert has_further_row(image.T, centres[..., ::-1]) == further


@pytest.mark.parametrize(("shown", "further"), [(1, False), (2, True)])
def test_single_disc_is_not_a_further_row(shown: int, further: bool) -> None:
    """Two discs of a row whose other positions are outside of the image are a row."""
    image, centres = discs(5, 4)
    skew = centres.copy()
    skew[0, shown:, 1] = 100.0  # the places before these are above the image
    assert _has_discs(image, skew[:2], 125.0) == further


def test_dark_stripe_is_not_a_row_of_discs() -> None:
    """A row of discs requires paper between the discs."""
    image, centres = discs(5, 4)
    image[:20] = 30
    assert not has_further_row(image, centres)


FRONT = SE3(np.eye(3), np.array([0.0, 0.0, 0.6]))


@pytest.fixture(scope="module")
def disc_image() -> tuple[np.ndarray, Array]:
    """Image of discs, and the pixels of their centres."""
    pose = at(SHAPE, FRONT)
    return render(SMALL, SHAPE, pose), SMALL.project(pose @ SHAPE.points)


def test_outlines_are_trusted_only_at_discs(disc_image: tuple[np.ndarray, Array]) -> None:
    """An outline is not trusted if the search began more than 3 px away, nor on bare paper."""
    image, start = disc_image[0].copy(), disc_image[1].copy()
    left, top = np.rint(start[9]).astype(int) - 9
    image[top : top + 19, left : left + 19] = 200 + np.random.default_rng(0).integers(-2, 3, (19, 19))
    start[20] += [3.5, 0.0]
    start[21] += [2.5, 0.0]
    outlines = _fit_outlines(image, SHAPE, start)
    assert np.flatnonzero(~outlines.trusted).tolist() == [9, 20]
    kept = outlines.trusted
    np.testing.assert_allclose(outlines.shape[kept, :2], disc_image[1][kept], atol=0.1)
    assert outlines.shared_residual[kept].max() < 0.1
    assert np.all((outlines.variance[kept] > 1e-5) & (outlines.variance[kept] < 1e-2))


def test_reversed_rows_are_reordered(monkeypatch: pytest.MonkeyPatch, disc_image: tuple[np.ndarray, Array]) -> None:
    """A grid found in reverse order is reordered, because a print cannot be seen from behind."""
    image, places = disc_image
    for order in (places, places.reshape(5, 8, 2)[::-1].reshape(-1, 2)):
        monkeypatch.setattr(circles, "best_result", lambda *_, order=order: order)
        found = detect(image, SHAPE)
        assert found is not None
        np.testing.assert_allclose(found.pixels, places, atol=0.1)


@pytest.mark.parametrize(("count", "left", "known"), [(4, 0.09, True), (3, 0.09, False), (4, 0.11, False)])
def test_grid_requires_four_round_discs(
    monkeypatch: pytest.MonkeyPatch, disc_image: tuple[np.ndarray, Array], count: int, left: float, known: bool
) -> None:
    """Residuals beyond noise must be below a tenth of the contrast. Sigmas are at least those of the model."""
    image, places = disc_image
    shape = np.column_stack([places, np.tile([2.0, 0.0, 2.0, 0.0], (40, 1))])
    trusted = np.isin(np.arange(40), [0, 7, 32, 39][:count])
    outlines = _Outlines(shape, np.zeros(40), trusted, np.full(40, left))
    monkeypatch.setattr(circles, "_fit_outlines", lambda *_: outlines)
    monkeypatch.setattr(circles, "best_result", lambda *_: places)
    found = circles._detect_dark(image, SHAPE)
    assert (found is not None) == known
    if found is not None:
        assert found.ids.tolist() == [0, 7, 32, 39]
        assert found.sigma_px.min() >= 0.0007
