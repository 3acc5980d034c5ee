"""Tests of rendered images of printed targets."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import ndtr

from basecal.cell.targets.chessboard import chessboard_target
from basecal.cell.targets.circles import RADIUS, circles_target
from basecal.errors import InputError
from basecal.geometry import SE3, Array, Camera
from basecal.vision.draw.render import (
    RenderSettings,
    _window,
    background,
    blur_image,
    coverage,
    expose,
    quantise,
    radiance,
    render,
)
from basecal.vision.fit.corner_shapes import saddle
from basecal.vision.fit.corners import Window, refine_corners
from basecal.vision.fit.local_map import local_axes
from quick import quick
from vision_scenes import FISHEYE, PLAIN, SMALL, TARGETS, WIDE, poses

CLEAN = RenderSettings(noise=0.0)


@pytest.mark.journey
@pytest.mark.parametrize("camera", [PLAIN, WIDE, FISHEYE], ids=["plain", "wide", "fisheye"])
@pytest.mark.parametrize("blur", quick([0.5, 1.0, 2.0], [0.5]))
def test_corners_are_unbiased(camera: Camera, blur: float) -> None:
    """Corners fitted in noiseless images are at their projections, within 0.005 px rms."""
    shape = TARGETS["chessboard"]
    error = []
    for pose in poses(shape, 3, np.random.default_rng(0)):
        levels = radiance(camera, [(shape, pose)], RenderSettings(blur_px=blur))
        true = camera.project(pose @ shape.points)
        axes = local_axes(shape.points[:, :2], shape.points[:, :2], true, 0.03)
        inside = np.all((true > 15) & (true < np.array(levels.shape[::-1]) - 15), axis=1)
        fitted = refine_corners(levels, saddle, true[inside] + 0.3, axes[inside], Window(7.0, 0.7, 0.7, 0.7, 0.7))
        assert fitted.trusted.all()
        error.append(fitted.pixels - true[inside])
    assert np.sqrt(np.mean(np.concatenate(error) ** 2)) < 0.005


def test_disc_has_exact_area_and_centre() -> None:
    """The missing light of a frontal disc is that of its exact area, with its exact centroid."""
    dot = circles_target((1, 1), 0.1)
    middle = np.array([0.013, -0.021, 1.0])
    levels = radiance(PLAIN, [(dot, SE3(np.eye(3), middle))], replace(CLEAN, background=200.0, blur_px=1.5))
    missing = (200.0 - levels) / 170.0
    row, column = np.indices(levels.shape)
    centre = np.array([(missing * column).sum(), (missing * row).sum()]) / missing.sum()
    np.testing.assert_allclose(centre, PLAIN.project(middle), atol=1e-3)
    assert missing.sum() == pytest.approx(np.pi * (500 * 0.1 * RADIUS) ** 2, rel=1e-4)


def test_edge_profile_is_blurred_pixel_square() -> None:
    """An edge has the profile of the pixel's square under a Gaussian, within half a percent."""
    board = chessboard_target((3, 3), 0.2)
    levels = radiance(PLAIN, [(board, SE3(np.eye(3), np.array([0.0, 0.0, 1.0])))], replace(CLEAN, blur_px=1.0))
    at = np.arange(310, 330)
    finer = np.linspace(-0.5, 0.5, 201)[:-1] + 0.0025
    share = ndtr(at[:, None] + finer - 319.5).mean(axis=1)
    np.testing.assert_allclose(levels[190, at], 30 + 170 * share, atol=0.85)


def test_background_has_stated_noise() -> None:
    """The plain background has the stated mean and noise, and another seed gives other noise."""
    behind = SE3(np.eye(3), np.array([0.0, 0.0, -1.0]))
    first, again, other = (
        render(PLAIN, TARGETS["chessboard"], behind, RenderSettings(noise=3.0), k) for k in (1, 1, 2)
    )
    np.testing.assert_array_equal(first, again)
    assert first.mean() == pytest.approx(110, abs=0.05)  # 5 sigmas of the mean over 307,200 pixels are 0.03
    assert first.std() == pytest.approx(np.sqrt(9 + 1 / 12), rel=0.01)
    assert np.mean(first == other) < 0.2


def test_sixteen_bit_levels_are_scaled_by_257() -> None:
    """A 16-bit image has the levels of an 8-bit one times 257."""
    pose = poses(TARGETS["tags"], 1, np.random.default_rng(1))[0]
    eight, sixteen = (render(PLAIN, TARGETS["tags"], pose, replace(CLEAN, bits=bits)) for bits in (8, 16))
    assert (eight.dtype, sixteen.dtype) == (np.uint8, np.uint16)
    np.testing.assert_allclose(sixteen / 257, eight, atol=0.51)


def test_back_of_board_is_blank() -> None:
    """A board seen from behind is white paper."""
    board = chessboard_target((3, 3), 0.05)
    turned = SE3.from_rpy((np.pi, 0, 0), (-0.05, 0.05, 0.5))
    levels = radiance(PLAIN, [(board, turned)], CLEAN)
    assert set(np.unique(levels[220:260, 300:340].round(3))) == {200.0}


def test_nearer_sheet_occludes_farther_one() -> None:
    """The nearer of two overlapping sheets is visible, in either order of the arguments."""
    near, far = (
        (chessboard_target((3, 3), size), SE3(np.eye(3), np.array([0.0, 0.0, z])))
        for size, z in ((0.02, 0.4), (0.1, 0.8))
    )
    both = radiance(PLAIN, [near, far], CLEAN)
    np.testing.assert_array_equal(both, radiance(PLAIN, [far, near], CLEAN))
    np.testing.assert_allclose(both[230:260, 310:340], radiance(PLAIN, [near], CLEAN)[230:260, 310:340], atol=1e-3)


def test_texture_is_behind_the_board() -> None:
    """A textured background has the stated deviation and does not change the board."""
    shape = TARGETS["chessboard"]
    pose = SE3(np.eye(3), np.array([-0.1, -0.07, 0.5]))
    plain, rough = (radiance(WIDE, [(shape, pose)], replace(CLEAN, texture=each)) for each in (0.0, 20.0))
    board = slice(270, 450), slice(500, 760)
    np.testing.assert_allclose(plain[board], rough[board], atol=1e-3)
    assert np.std(rough[:, :300]) == pytest.approx(20.0, rel=0.25)  # a few dozen independent patches at most


def test_missing_size_and_invalid_bits_are_refused() -> None:
    """A camera without an image size and an unsupported number of bits are input errors."""
    pose = SE3(np.eye(3), np.array([0.0, 0.0, 1.0]))
    with pytest.raises(InputError, match="size_px"):
        render(Camera("pinhole", PLAIN.parameters), TARGETS["tags"], pose)
    with pytest.raises(InputError, match="bits is 12"):
        render(PLAIN, TARGETS["tags"], pose, RenderSettings(bits=12))


def edges(*loops: Array) -> Array:
    return np.concatenate([np.stack([loop, np.roll(loop, -1, axis=0)], axis=1) for loop in loops])


def area(loop: Array) -> float:
    x, y = loop.T
    return 0.5 * float(x @ np.roll(y, -1) - y @ np.roll(x, -1))


def polygon(rng: np.random.Generator, middle: tuple[float, float], radius: float) -> Array:
    angle = np.sort(rng.uniform(0, 2 * np.pi, 7))
    return np.array(middle) + radius * np.stack([np.cos(angle), np.sin(angle)], -1)


def test_coverage_of_rectangle_is_exact() -> None:
    """The coverage of each pixel is the product of the coverages along x and along y."""
    loop = np.array([[1.25, 0.5], [3.1, 0.5], [3.1, 2.2], [1.25, 2.2]])
    across, down = np.array([0, 0.25, 1, 0.6, 0]), np.array([0, 1, 0.7, 0])
    np.testing.assert_allclose(coverage(edges(loop), (5, 4)), np.outer([0, *down[1:]], across), atol=1e-12)


@pytest.mark.parametrize("seed", range(5))
def test_coverage_adds_up_to_area(seed: int) -> None:
    """The coverages of all pixels add up to the polygon's area."""
    loop = polygon(np.random.default_rng(seed), (15.3, 14.8), 11.0)
    assert coverage(edges(loop), (30, 30)).sum() == pytest.approx(area(loop), rel=1e-12)


def test_coverage_matches_sampling() -> None:
    """The coverage of each pixel agrees with a dense grid of samples, within the grid's resolution."""
    loop = polygon(np.random.default_rng(3), (6.2, 5.7), 5.0)
    fine = 64
    at = (np.arange(12 * fine) + 0.5) / fine - 0.5
    x, y = np.meshgrid(at, at)
    sides = [(b - a)[0] * (y - a[1]) - (b - a)[1] * (x - a[0]) > 0 for a, b in edges(loop)]
    sampled = np.all(sides, axis=0).reshape(12, fine, 12, fine).mean(axis=(1, 3))
    np.testing.assert_allclose(coverage(edges(loop), (12, 12)), sampled, atol=0.01)


def test_coverage_is_independent_of_outside() -> None:
    """The parts of a polygon outside of the image do not change the coverage inside."""
    loop = polygon(np.random.default_rng(1), (4.0, 5.0), 9.0)
    whole = coverage(edges(loop + 20), (60, 60))[20:28, 20:30]
    np.testing.assert_allclose(coverage(edges(loop), (10, 8)), whole, atol=1e-9)


def test_shared_edges_cancel() -> None:
    """Two outlines that share a slanted edge cover as much as their union."""
    left = np.array([[0.3, 0.1], [3.0, 0.4], [4.2, 7.3], [0.6, 6.6]])
    right = np.array([[3.0, 0.4], [8.1, 0.2], [7.7, 7.1], [4.2, 7.3]])
    union = np.array([[0.3, 0.1], [3.0, 0.4], [8.1, 0.2], [7.7, 7.1], [4.2, 7.3], [0.6, 6.6]])
    np.testing.assert_allclose(coverage(edges(left, right), (10, 9)), coverage(edges(union), (10, 9)), atol=1e-12)


def test_paper_has_exact_area() -> None:
    """Paper seen from behind, on black, has its area to 1e-5 and its exact centroid."""
    board = chessboard_target((3, 3), 0.05)
    behind = SE3.from_rpy((np.pi, 0, 0), (-0.05, 0.05, 0.5))
    levels = radiance(PLAIN, [(board, behind)], replace(CLEAN, background=0.0))
    left, top, right, bottom = board.sheets[0].paper
    assert levels.sum() / 200 == pytest.approx((right - left) * (bottom - top) * 1000**2, rel=1e-5)
    row, column = np.indices(levels.shape)
    corners = np.array([[left, top, 0], [right, bottom, 0]])
    middle = PLAIN.project(behind @ board.sheets[0].target_from_sheet @ corners).mean(0)
    centre = np.array([(levels * column).sum(), (levels * row).sum()]) / levels.sum()
    np.testing.assert_allclose(centre, middle, atol=1e-4)


def test_faint_texture_has_mean_of_background() -> None:
    """A texture of half a level is drawn, also in small images, about the level of the background.

    Seeds give different textures, and the default is 0.
    """
    rough, other = (background((320, 240), 110.0, 0.5, seed) for seed in (0, 1))
    assert rough.shape == (240, 320)
    assert 0.2 < rough.std() < 0.8
    assert rough.mean() == pytest.approx(110, abs=0.5)
    assert np.abs(rough - other).max() > 0.5
    small = replace(PLAIN, size_px=(160, 120))
    settings = RenderSettings(texture=20.0)
    levels = radiance(small, [], settings)
    np.testing.assert_array_equal(levels, radiance(small, [], settings, 0))
    assert np.abs(levels - radiance(small, [], settings, 1)).max() > 1
    np.testing.assert_array_equal(expose(levels, settings), expose(levels, settings, 0))
    assert np.any(expose(levels, settings) != expose(levels, settings, 1))


def test_default_exposure() -> None:
    """The default background has a level of 110 with a noise of two; 16 bits have 257 times as many levels."""
    plain = expose(background((320, 240), 110.0, 0.0, 0), RenderSettings()).astype(float)
    assert plain.mean() == pytest.approx(110, abs=0.05)
    assert plain.var() == pytest.approx(4 + 1 / 12, rel=0.03)
    bare = radiance(replace(PLAIN, size_px=(32, 24)), [], RenderSettings())
    np.testing.assert_allclose(bare, np.full((24, 32), 110.0), rtol=1e-6)
    levels = np.array([[-1.0, 0.0, 127.6, 255.0, 300.0]])
    assert quantise(levels, 8).tolist() == [[0, 0, 128, 255, 255]]
    assert quantise(levels, 16).tolist() == [[0, 0, 32793, 65535, 65535]]


def test_zero_blur_changes_nothing() -> None:
    """A blur of half a pixel keeps the sum of an interior spot."""
    image = np.zeros((21, 21), np.float32)
    image[10, 10] = 1
    assert blur_image(image, 0.0) is image
    blurred = blur_image(image, 0.5)
    assert blurred.sum() == pytest.approx(1)
    assert blurred[10, 9] / blurred[10, 10] == pytest.approx(np.exp(-2), rel=1e-3)


def test_blur_is_truncated_at_4_5_sigma() -> None:
    """A spot of a million levels ends at 4.5 sigma."""
    image = np.zeros((41, 41), np.float32)
    image[20, 20] = 1e6
    assert np.flatnonzero(blur_image(image, 2.0)[20]).tolist() == list(range(11, 30))


def test_default_ink_and_paper_levels() -> None:
    """Ink and paper have levels 30 and 200 of 255, before a background of 110."""
    levels = radiance(SMALL, [(chessboard_target((3, 3), 0.05), SE3(np.eye(3), np.array([-0.1, -0.1, 0.6])))], CLEAN)
    assert levels.min() == pytest.approx(30, abs=0.01)
    assert levels.max() == pytest.approx(200, abs=0.01)
    assert levels[0, -1] == pytest.approx(110, abs=0.01)


def test_window_of_edges_is_clipped_to_image() -> None:
    """The window is from the first to the last row and column that edges touch. Edges outside have none."""
    edges = np.array([[[-3.0, 2.5], [4.2, 9.0]]])
    assert _window(edges, (8, 20)) == (slice(2, 8), slice(0, 6))
    assert _window(edges + 5, (20, 20)) == (slice(7, 15), slice(2, 11))
    assert _window(edges - 10, (20, 20)) is None
    assert _window(edges[:0], (20, 20)) is None
