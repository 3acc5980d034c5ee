"""Tests of the refinement of corners in images."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from basecal.geometry import Array
from basecal.vision.fit.corner_shapes import saddle
from basecal.vision.fit.corners import (
    BOARD_ARM_PX,
    Window,
    _accepted_fits,
    _Context,
    _cross_mask,
    _estimate_blur,
    _parameters,
    _pixel_error_px,
    cut_patches,
    refine_corners,
)
from basecal.vision.fit.patch_fit import Fit

WINDOW = Window(arm_px=BOARD_ARM_PX, arm=0.7, inside=0.7, outside=0.7, before=0.7)
PITCH = 24.0
PLACES = np.stack(np.meshgrid(np.arange(8), np.arange(6)), -1).reshape(-1, 2) * PITCH + [40.3, 38.7]
AXES = np.broadcast_to(PITCH * np.eye(2), (len(PLACES), 2, 2))


def board(noise: float, spread: float = 1.0, share: float = 0.0, seed: int = 0) -> Array:
    """Levels of squares with corners at PLACES, each patch drawn about its own corner, (220, 260)."""
    image = np.full((220, 260), 100.0)
    steps = np.stack(np.meshgrid(np.arange(-12, 13), np.arange(-12, 13)), -1).reshape(1, -1, 2)
    for k, place in enumerate(PLACES):
        middle = np.rint(place)
        sign = (-1) ** (k // 8 + k % 8)
        q = np.array([[*(place - middle), 0.0, -np.pi / 2, np.log(spread), share]])
        left, top = (middle - 12).astype(int)
        image[top : top + 25, left : left + 25] = 100 + sign * 60 * saddle(q, steps.astype(float)).reshape(25, 25)
    return image + noise * np.random.default_rng(seed).standard_normal(image.shape)


@pytest.mark.journey
@pytest.mark.parametrize(
    ("noise", "spread", "share"), [(1.0, 0.7, 0.0), (4.0, 1.0, 0.0), (4.0, 2.0, 0.0), (2.0, 1.0, 1.0)]
)
def test_corner_errors_match_sigmas(noise: float, spread: float, share: float) -> None:
    """Corners up to a pixel away from their start are found within their sigmas, in sharpened images as well."""
    errors, sigmas = [], []
    for seed in range(4):
        start = PLACES + np.random.default_rng(seed + 10).uniform(-1, 1, PLACES.shape)
        found = refine_corners(board(noise, spread, share, seed), saddle, start, AXES, WINDOW)
        assert found.trusted.mean() > 0.97
        errors.append((found.pixels - PLACES)[found.trusted])
        sigmas.append(found.sigma_px[found.trusted])
    ratio = np.concatenate(errors) / np.concatenate(sigmas)[:, None]
    # The rms of 384 coordinates has a sigma of 3.6 %.
    assert np.sqrt(np.mean(ratio**2)) == pytest.approx(1.0, abs=0.15)


def test_pixel_error_is_largest_along_rows_and_columns() -> None:
    """The error by the pixels' squares is symmetric about both axes.

    It decreases with the number of pixels that a line crosses, down to the diagonal's.
    """
    shapes = np.zeros((9, 6))
    along = np.array([0.0, 0.2, -0.2, np.pi / 2 + 0.2, np.pi / 2 - 0.2, 0.5, np.pi - 0.5, np.pi / 4, -3 * np.pi / 4])
    shapes[:, 2:4] = along[:, None]
    error = _pixel_error_px(shapes)
    np.testing.assert_allclose(error[[2, 3, 4]], error[1])
    np.testing.assert_allclose(error[6], error[5])
    np.testing.assert_allclose(error[8], error[7])
    assert error[0] > error[1] > error[5] > error[7]
    crossed = 2 * BOARD_ARM_PX * np.tan(0.2)
    assert error[0] / error[1] == pytest.approx(1 + np.pi * crossed)  # remainder of a harmonic
    sharp = [_pixel_error_px(shapes + log_spread * np.eye(6)[4]) for log_spread in (-5.0, -7.0)]
    np.testing.assert_allclose(sharp[0], sharp[1])  # the spread is at least that of the pixel's square
    assert np.all(error < sharp[0])


def test_gain_has_sign_of_the_corner() -> None:
    """The gain of a corner has the sign and size of its step."""
    found = refine_corners(board(1.0), saddle, PLACES, AXES, WINDOW)
    row, column = np.divmod(np.arange(len(PLACES)), 8)
    np.testing.assert_allclose(found.gain, 60.0 * (-1.0) ** (row + column), atol=1.0)


@pytest.mark.journey
def test_noise_and_edges_are_not_trusted() -> None:
    """No fit is trusted in noise, and few on a single edge. Without corners the result is empty."""
    noise = 100 + np.random.default_rng(0).standard_normal((220, 260))
    edge = noise + 60 * (np.arange(260) > 130)
    assert not refine_corners(noise, saddle, PLACES, AXES, WINDOW).trusted.any()
    assert refine_corners(edge, saddle, PLACES, AXES, WINDOW).trusted.mean() < 0.1
    assert len(refine_corners(noise, saddle, PLACES[:0], AXES[:0], WINDOW).pixels) == 0


def test_thinned_start_keeps_accuracy() -> None:
    """Large windows start with a fifth of their pixels. Corners are as accurate as with all pixels."""
    large = replace(WINDOW, arm_px=11.0, arm=0.45, outside=0.45, inside=0.45, before=0.45)
    start = PLACES + np.random.default_rng(1).uniform(-1, 1, PLACES.shape)
    found = refine_corners(board(2.0), saddle, start, AXES, large)
    few = refine_corners(board(2.0)[:, :60], saddle, start[:1], AXES[:1], replace(large, arm_px=6.0))
    ratio = (found.pixels - PLACES) / found.sigma_px[:, None]
    assert found.trusted.all()
    assert few.trusted.all()
    # The rms of 96 coordinates has a sigma of 7 %.
    assert np.sqrt(np.mean(ratio**2)) == pytest.approx(1.0, abs=0.3)
    assert np.linalg.norm(few.pixels[0] - PLACES[0]) < 4 * few.sigma_px[0]


def test_thinned_patch_covers_all_rows_and_columns() -> None:
    """One of five pixels remains, and each row and column of a patch has some."""
    (xy,) = cut_patches(np.zeros((40, 40)), np.array([[20.0, 20.0]]), 7, 5).xy
    assert len(xy) == 15 * 15 / 5
    assert set(xy[:, 0]) == set(xy[:, 1]) == set(range(-7, 8))


def test_patch_pixels_outside_have_no_weight() -> None:
    """Pixels of a patch outside of the image have zero weight."""
    image = np.arange(20.0).reshape(4, 5)
    patches = cut_patches(image, np.array([[0.0, 0.0], [2.0, 2.0]]), 1)
    np.testing.assert_array_equal(patches.weights[0].reshape(3, 3), [[0, 0, 0], [0, 1, 1], [0, 1, 1]])
    np.testing.assert_array_equal(patches.values[1].reshape(3, 3), image[1:4, 1:4])


CROSS = Window(arm_px=100.0, arm=0.7, inside=0.3, outside=0.4, before=0.5)
SQUARE, SLANTED = np.array([[20.0, 0.0], [0.0, 20.0]]), np.array([[20.0, 0.0], [12.0, 16.0]])


def in_cross(
    xy: list[tuple[float, float]], window: Window = CROSS, spread: float = 0.5, axes: Array = SQUARE
) -> list[bool]:
    """Whether positions [px] beside a corner are in its window; the guard is twice the spread."""
    q = np.array([[0.0, 0.0, 0.0, 0.0, np.log(spread), 0.0]])
    context = _Context(np.zeros((1, 1)), saddle, axes[None], window)
    return _cross_mask(context, q, np.array([[5.0, 7.0]]), np.array(xy)[None] + [5.0, 7.0])[0].tolist()


def test_window_is_a_cross_along_both_lines() -> None:
    """Each border is at its stated distance, less the guard: of arms, beside them, and behind the corner."""
    arms = [(13.9, 0.1), (14.1, 0.1), (0.1, 13.9), (0.1, 14.1)]
    inside = [(8, 4.9), (8, 5.1), (4.9, 8), (5.1, 8)]
    outside = [(8, -6.9), (8, -7.1), (-6.9, 8), (-7.1, 8), (-6.9, -8), (-7.1, -8)]
    before = [(-8.9, 0.1), (-9.1, 0.1), (0.1, -8.9), (0.1, -9.1)]
    for places in (arms, inside, outside, before):
        assert in_cross(places) == [True, False] * (len(places) // 2)


def test_arm_length_is_limited_in_pixels() -> None:
    """The arms are limited in pixels, for any pitch, so that the lines are straight."""
    assert in_cross([(8.9, 0.1), (9.1, 0.1), (0.1, 8.9), (0.1, 9.1)], replace(CROSS, arm_px=9.0)) == [True, False] * 2


def test_wide_spread_keeps_band_along_lines() -> None:
    """A band of 1.6 px on each side remains if the guard is wider than the window."""
    assert in_cross([(8, 1.5), (8, 1.7), (1.5, -1.9), (1.7, -1.9)], spread=4.0) == [True, False] * 2
    assert in_cross([(-1.9, 0.1), (-2.1, 0.1)], spread=4.0) == [True, False]


def test_slanted_window_borders_are_normal_distances() -> None:
    """The borders are 4.8 px, less the guard of 1 px, from either line."""
    away = np.array([0.8, -0.6])
    along = np.array([6.0, 8.0])
    places = [(10, 3.7), (10, 3.9), *(tuple(along + length * away) for length in (3.7, 3.9))]
    assert in_cross(places, axes=SLANTED) == [True, False] * 2


@pytest.mark.parametrize(("noise", "share"), [(1.0, 0.0), (6.0, 0.0), (1.0, 0.5)])
def test_blur_estimate_matches_image(noise: float, share: float) -> None:
    """The estimated spread is within 3 %, and an image without sharpening has an estimate of zero."""
    log_spread, found = _estimate_blur(board(noise, 0.8, share), saddle, PLACES, AXES, WINDOW)
    assert np.exp(log_spread) == pytest.approx(0.8, rel=0.03)
    assert found == pytest.approx(share, abs=0.03)
    assert (found == 0) == (share == 0)


@pytest.mark.parametrize(("noise", "spread", "share", "limit"), [(1.0, 0.4, -0.9, -0.5), (4.0, 3.5, 0.0, 3.0)])
def test_blur_estimate_is_that_of_a_camera(noise: float, spread: float, share: float, limit: float) -> None:
    """Cameras soften an image by at most half, and sharpen it by at most three; stronger estimates are limited."""
    assert _estimate_blur(board(noise, spread, share), saddle, PLACES, AXES, WINDOW)[1] == limit


def test_blur_estimate_without_corners_has_defaults() -> None:
    """The defaults are a spread of a pixel and no sharpening."""
    assert _estimate_blur(np.full((220, 260), 100.0), saddle, PLACES, AXES, WINDOW).tolist() == [0.0, 0.0]


@pytest.mark.parametrize(
    ("moved", "spread", "converged", "accepted"),
    [
        ((2.0, 2.2), 1.0, True, True),
        ((2.0, 2.3), 1.0, True, False),
        ((0.0, 0.0), 5.9, True, True),
        ((0.0, 0.0), 6.1, True, False),
        ((0.0, 0.0), 1.0, False, False),
    ],
)
def test_fit_is_accepted_near_its_start(
    moved: tuple[float, float], spread: float, converged: bool, accepted: bool
) -> None:
    """A fit is accepted within 3 px, with a spread below 6 px, if it converged."""
    shape = np.array([[40 + moved[0], 30 + moved[1], 0.0, 0.0, np.log(spread), 0.0]])
    fit = Fit(shape, np.ones((1, 1)), np.zeros((1, 6, 6)), np.zeros((1, 1)), np.array([converged]))
    assert _accepted_fits(fit, np.array([[40.0, 30.0]])).tolist() == [accepted]


def test_initial_lines_are_the_axes() -> None:
    """The second line is opposite to its axis, so that both have the corner to their right."""
    q = _parameters(np.array([[40.0, 30.0]]), np.array([[[3.0, 3.0], [0.0, -2.0]]]))
    np.testing.assert_allclose(q, [[40, 30, np.pi / 4, np.pi / 2, 0, 0]])


def test_noise_accounts_for_fitted_parameters() -> None:
    """Ten numbers are fitted to 36 pixels. Errors over sigmas follow Student's t with 26 degrees of freedom."""
    small, ratio = replace(WINDOW, arm_px=3.0), []
    for seed in range(4):
        found = refine_corners(board(3.0, 0.8, 0.0, seed), saddle, PLACES, AXES, small)
        assert found.trusted.all()
        ratio.append((found.pixels - PLACES) / found.sigma_px[:, None])
    # The rms of 384 coordinates has a sigma of 3.6 %.
    assert np.sqrt(np.mean(np.square(ratio))) == pytest.approx(np.sqrt(26 / 24), abs=0.1)


def test_pixel_error_decreases_with_spread() -> None:
    """The error is the first harmonic of a Gaussian with the spread, of which the pixel's square is a part.

    Both lines contribute.
    """
    sharp, wide = (np.array([[0.0, 0, 0, 0, np.log(spread), 0]]) for spread in (0.2, 0.6))
    ratio = _pixel_error_px(wide)[0] / _pixel_error_px(sharp)[0]
    assert ratio == pytest.approx(np.exp(-2 * np.pi**2 * (0.36 - 1 / 12)), rel=1e-9)
    slanted, mixed = sharp.copy(), sharp.copy()
    slanted[0, 2:4], mixed[0, 2] = 0.3, 0.3
    both = [_pixel_error_px(each)[0] ** 2 for each in (sharp, slanted)]
    assert _pixel_error_px(mixed)[0] ** 2 == pytest.approx(np.mean(both))


def test_window_borders_follow_each_axis_length() -> None:
    """A band beside a line is measured along the other axis, of 10 and of 40 px here, each less 1 px."""
    axes = np.array([[10.0, 0.0], [0.0, 40.0]])
    window = Window(arm_px=100.0, arm=2.0, inside=0.45, outside=0.45, before=1.5)
    assert in_cross([(3.4, 30), (3.6, 30), (8, 16.9), (8, 17.1)], window, axes=axes) == [True, False] * 2
