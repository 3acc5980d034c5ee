"""Corners refined in images."""

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
    """Levels of squares whose corners stand at PLACES, each piece drawn about its own corner, (220, 260)."""
    image = np.full((220, 260), 100.0)
    steps = np.stack(np.meshgrid(np.arange(-12, 13), np.arange(-12, 13)), -1).reshape(1, -1, 2)
    for k, place in enumerate(PLACES):
        middle = np.rint(place)
        sign = (-1) ** (k // 8 + k % 8)
        q = np.array([[*(place - middle), 0.0, -np.pi / 2, np.log(spread), share]])
        left, top = (middle - 12).astype(int)
        image[top : top + 25, left : left + 25] = 100 + sign * 60 * saddle(q, steps.astype(float)).reshape(25, 25)
    return image + noise * np.random.default_rng(seed).standard_normal(image.shape)


@pytest.mark.parametrize(
    ("noise", "spread", "share"), [(1.0, 0.7, 0.0), (4.0, 1.0, 0.0), (4.0, 2.0, 0.0), (2.0, 1.0, 1.0)]
)
def test_errors_are_as_large_as_sigmas(noise: float, spread: float, share: float) -> None:
    """Corners up to a pixel away from where they are sought are found within their sigmas, sharpened images too."""
    errors, sigmas = [], []
    for seed in range(4):
        start = PLACES + np.random.default_rng(seed + 10).uniform(-1, 1, PLACES.shape)
        found = refine_corners(board(noise, spread, share, seed), saddle, start, AXES, WINDOW)
        assert found.trusted.mean() > 0.97
        errors.append((found.pixels - PLACES)[found.trusted])
        sigmas.append(found.sigma_px[found.trusted])
    ratio = np.concatenate(errors) / np.concatenate(sigmas)[:, None]
    # Of 384 coordinates an rms has a sigma of 3.6 %.
    assert np.sqrt(np.mean(ratio**2)) == pytest.approx(1.0, abs=0.15)


def test_squares_of_pixels_matter_along_rows_and_columns() -> None:
    """As much to either side of both, and less the more of them a line crosses, down to the diagonal's."""
    shapes = np.zeros((9, 6))
    along = np.array([0.0, 0.2, -0.2, np.pi / 2 + 0.2, np.pi / 2 - 0.2, 0.5, np.pi - 0.5, np.pi / 4, -3 * np.pi / 4])
    shapes[:, 2:4] = along[:, None]
    error = _pixel_error_px(shapes)
    np.testing.assert_allclose(error[[2, 3, 4]], error[1])
    np.testing.assert_allclose(error[6], error[5])
    np.testing.assert_allclose(error[8], error[7])
    assert error[0] > error[1] > error[5] > error[7]
    crossed = 2 * BOARD_ARM_PX * np.tan(0.2)
    assert error[0] / error[1] == pytest.approx(1 + np.pi * crossed)  # what a harmonic leaves over so many periods
    sharp = [_pixel_error_px(shapes + log_spread * np.eye(6)[4]) for log_spread in (-5.0, -7.0)]
    np.testing.assert_allclose(sharp[0], sharp[1])  # narrower than a pixel the spread is that of its square
    assert np.all(error < sharp[0])


def test_gain_tells_which_side_is_bright() -> None:
    """The step of a corner has its sign and size."""
    found = refine_corners(board(1.0), saddle, PLACES, AXES, WINDOW)
    row, column = np.divmod(np.arange(len(PLACES)), 8)
    np.testing.assert_allclose(found.gain, 60.0 * (-1.0) ** (row + column), atol=1.0)


def test_no_corner_is_not_trusted() -> None:
    """Where there is noise or an edge alone, nothing is trusted; without corners there is nothing."""
    noise = 100 + np.random.default_rng(0).standard_normal((220, 260))
    edge = noise + 60 * (np.arange(260) > 130)
    assert not refine_corners(noise, saddle, PLACES, AXES, WINDOW).trusted.any()
    assert refine_corners(edge, saddle, PLACES, AXES, WINDOW).trusted.mean() < 0.1
    assert len(refine_corners(noise, saddle, PLACES[:0], AXES[:0], WINDOW).pixels) == 0


def test_large_windows_are_begun_with_a_part_of_their_pixels() -> None:
    """Where a fifth of the pixels is enough to begin with, corners are as near and as sure as where it is not."""
    large = replace(WINDOW, arm_px=11.0, arm=0.45, outside=0.45, inside=0.45, before=0.45)
    start = PLACES + np.random.default_rng(1).uniform(-1, 1, PLACES.shape)
    found = refine_corners(board(2.0), saddle, start, AXES, large)
    few = refine_corners(board(2.0)[:, :60], saddle, start[:1], AXES[:1], replace(large, arm_px=6.0))
    ratio = (found.pixels - PLACES) / found.sigma_px[:, None]
    assert found.trusted.all()
    assert few.trusted.all()
    # Of 96 coordinates an rms has a sigma of 7 %.
    assert np.sqrt(np.mean(ratio**2)) == pytest.approx(1.0, abs=0.3)
    assert np.linalg.norm(few.pixels[0] - PLACES[0]) < 4 * few.sigma_px[0]


def test_thinned_pieces_have_pixels_of_every_row_and_column() -> None:
    """One of five pixels is left, and each row and column of a piece has some."""
    (xy,) = cut_patches(np.zeros((40, 40)), np.array([[20.0, 20.0]]), 7, 5).xy
    assert len(xy) == 15 * 15 / 5
    assert set(xy[:, 0]) == set(xy[:, 1]) == set(range(-7, 8))


def test_pieces_at_the_border() -> None:
    """Pixels of a piece that are outside the image weigh nothing."""
    image = np.arange(20.0).reshape(4, 5)
    patches = cut_patches(image, np.array([[0.0, 0.0], [2.0, 2.0]]), 1)
    np.testing.assert_array_equal(patches.weights[0].reshape(3, 3), [[0, 0, 0], [0, 1, 1], [0, 1, 1]])
    np.testing.assert_array_equal(patches.values[1].reshape(3, 3), image[1:4, 1:4])


CROSS = Window(arm_px=100.0, arm=0.7, inside=0.3, outside=0.4, before=0.5)
SQUARE, SLANTED = np.array([[20.0, 0.0], [0.0, 20.0]]), np.array([[20.0, 0.0], [12.0, 16.0]])


def in_cross(
    xy: list[tuple[float, float]], window: Window = CROSS, spread: float = 0.5, axes: Array = SQUARE
) -> list[bool]:
    """Whether places [px] beside a corner are in its window; the guard is twice the spread."""
    q = np.array([[0.0, 0.0, 0.0, 0.0, np.log(spread), 0.0]])
    context = _Context(np.zeros((1, 1)), saddle, axes[None], window)
    return _cross_mask(context, q, np.array([[5.0, 7.0]]), np.array(xy)[None] + [5.0, 7.0])[0].tolist()


def test_the_window_is_a_cross_along_both_lines() -> None:
    """Each border is where it is stated, less the guard: of arms, beside them, and behind the corner."""
    arms = [(13.9, 0.1), (14.1, 0.1), (0.1, 13.9), (0.1, 14.1)]
    inside = [(8, 4.9), (8, 5.1), (4.9, 8), (5.1, 8)]
    outside = [(8, -6.9), (8, -7.1), (-6.9, 8), (-7.1, 8), (-6.9, -8), (-7.1, -8)]
    before = [(-8.9, 0.1), (-9.1, 0.1), (0.1, -8.9), (0.1, -9.1)]
    for places in (arms, inside, outside, before):
        assert in_cross(places) == [True, False] * (len(places) // 2)


def test_arms_are_short_enough_for_straight_lines() -> None:
    """In pixels, however large a pitch is."""
    assert in_cross([(8.9, 0.1), (9.1, 0.1), (0.1, 8.9), (0.1, 9.1)], replace(CROSS, arm_px=9.0)) == [True, False] * 2


def test_wide_spreads_leave_a_band_along_the_lines() -> None:
    """Of 1.6 px on each side, if the guard is wider than the window."""
    assert in_cross([(8, 1.5), (8, 1.7), (1.5, -1.9), (1.7, -1.9)], spread=4.0) == [True, False] * 2
    assert in_cross([(-1.9, 0.1), (-2.1, 0.1)], spread=4.0) == [True, False]


def test_borders_of_a_slanted_cross_are_distances_from_its_lines() -> None:
    """Of 4.8 px, less the guard of 1 px, from either line."""
    away = np.array([0.8, -0.6])
    along = np.array([6.0, 8.0])
    places = [(10, 3.7), (10, 3.9), *(tuple(along + length * away) for length in (3.7, 3.9))]
    assert in_cross(places, axes=SLANTED) == [True, False] * 2


@pytest.mark.parametrize(("noise", "share"), [(1.0, 0.0), (6.0, 0.0), (1.0, 0.5)])
def test_the_lens_is_that_of_the_image(noise: float, share: float) -> None:
    """Its spread within 3 %; a camera that does not sharpen is found to be one."""
    log_spread, found = _estimate_blur(board(noise, 0.8, share), saddle, PLACES, AXES, WINDOW)
    assert np.exp(log_spread) == pytest.approx(0.8, rel=0.03)
    assert found == pytest.approx(share, abs=0.03)
    assert (found == 0) == (share == 0)


def test_without_corners_the_lens_is_a_typical_one() -> None:
    """A spread of a pixel, and no sharpening."""
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
def test_a_fit_is_accepted_near_its_start(
    moved: tuple[float, float], spread: float, converged: bool, accepted: bool
) -> None:
    """Within 3 px, with a spread below 6 px, if it converged."""
    shape = np.array([[40 + moved[0], 30 + moved[1], 0.0, 0.0, np.log(spread), 0.0]])
    fit = Fit(shape, np.ones((1, 1)), np.zeros((1, 6, 6)), np.zeros((1, 1)), np.array([converged]))
    assert _accepted_fits(fit, np.array([[40.0, 30.0]])).tolist() == [accepted]


def test_initial_lines_are_the_axes() -> None:
    """The second is against its axis, so that both have the corner to their right."""
    q = _parameters(np.array([[40.0, 30.0]]), np.array([[[3.0, 3.0], [0.0, -2.0]]]))
    np.testing.assert_allclose(q, [[40, 30, np.pi / 4, np.pi / 2, 0, 0]])


def test_noise_is_that_of_few_pixels_less_their_parameters() -> None:
    """Of 36 pixels, ten numbers are fitted: errors over sigmas are those of Student's t with 26 degrees of freedom."""
    small, ratio = replace(WINDOW, arm_px=3.0), []
    for seed in range(4):
        found = refine_corners(board(3.0, 0.8, 0.0, seed), saddle, PLACES, AXES, small)
        assert found.trusted.all()
        ratio.append((found.pixels - PLACES) / found.sigma_px[:, None])
    # Of 384 coordinates an rms has a sigma of 3.6 %.
    assert np.sqrt(np.mean(np.square(ratio))) == pytest.approx(np.sqrt(26 / 24), abs=0.1)


def test_squares_of_pixels_matter_less_the_wider_the_spread_is() -> None:
    """As the first harmonic of a Gaussian with the spread, of which a pixel's square is a part; both lines count."""
    sharp, wide = (np.array([[0.0, 0, 0, 0, np.log(spread), 0]]) for spread in (0.2, 0.6))
    ratio = _pixel_error_px(wide)[0] / _pixel_error_px(sharp)[0]
    assert ratio == pytest.approx(np.exp(-2 * np.pi**2 * (0.36 - 1 / 12)), rel=1e-9)
    slanted, mixed = sharp.copy(), sharp.copy()
    slanted[0, 2:4], mixed[0, 2] = 0.3, 0.3
    both = [_pixel_error_px(each)[0] ** 2 for each in (sharp, slanted)]
    assert _pixel_error_px(mixed)[0] ** 2 == pytest.approx(np.mean(both))


def test_guards_are_of_the_length_of_each_axis() -> None:
    """A band beside a line is measured along the other axis, of 10 and of 40 px here, each less 1 px."""
    axes = np.array([[10.0, 0.0], [0.0, 40.0]])
    window = Window(arm_px=100.0, arm=2.0, inside=0.45, outside=0.45, before=1.5)
    assert in_cross([(3.4, 30), (3.6, 30), (8, 16.9), (8, 17.1)], window, axes=axes) == [True, False] * 2
