"""Tests of the measured shift between two images."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.geometry import SE3
from basecal.vision.draw.render import RenderSettings, expose, radiance
from basecal.vision.image_motion import _block_sums, reduce_image, shift_between
from shared.facing_arms import facing_arms

WORLD = facing_arms()
BOARD, LENS = WORLD.cell.targets["board"].target, WORLD.lenses["wrist"]
SETTINGS = RenderSettings(texture=6.0)
AT = SE3(np.eye(3), np.array([0.0, 0.0, 0.65]) - BOARD.points.mean(0))


def levels(px):
    """Image of the board moved by pixels, equally along both axes."""
    along = px / 1010 * 0.65 / np.sqrt(2)
    return radiance(LENS, [(BOARD, SE3(np.eye(3), np.array([along, along, 0])) @ AT)], SETTINGS)


STILL = levels(0.0)


def image_shift(first, second):
    """Shift between two images [px]."""
    return shift_between(reduce_image(first), reduce_image(second))


@pytest.mark.journey
def test_noise_is_no_motion():
    """No shift is measured between twenty noisy images of the same board."""
    first = expose(STILL, SETTINGS, 0)
    assert [image_shift(first, expose(STILL, SETTINGS, seed)) for seed in range(1, 21)] == [0.0] * 20


@pytest.mark.parametrize("px", [0.2, 0.5, 1.0])
def test_subpixel_shift_is_measured(px):
    """A shift of a fifth of a pixel is detected, and measured within 20 %."""
    assert image_shift(expose(STILL, SETTINGS, 0), expose(levels(px), SETTINGS, 1)) == pytest.approx(px, rel=0.2)


def test_shift_of_plain_and_resized_images():
    """A plain image has no shift; the shift to an image of another size is infinite."""
    plain = np.full((240, 320), 100, dtype=np.uint8)
    assert image_shift(plain, plain) == 0.0
    assert shift_between(reduce_image(plain), reduce_image(plain[:200])) == np.inf


def streak(turn, off, x0=120.0, y0=120.0):
    """Wall with a bright streak, moved across its length, without rounding, (240, 320)."""
    x, y = np.meshgrid(np.arange(320.0) - x0, np.arange(240.0) - y0)
    across, along = x * np.cos(turn) + y * np.sin(turn) - off, y * np.cos(turn) - x * np.sin(turn)
    return 100 * (1 + np.exp(-0.5 * (across / 6) ** 2 - 0.5 * (along / 18) ** 2))


@pytest.mark.parametrize("turn", [0.0, 0.3, np.pi / 4, np.pi / 2, 2.0, 3 * np.pi / 4])
def test_shift_is_measured_across_edges(turn):
    """The shift across a streak is measured in any direction and with either sign."""
    for off in (0.4, -0.4):
        assert image_shift(streak(turn, 0.0), streak(turn, off)) == pytest.approx(0.4, rel=0.05)


def test_largest_local_shift_is_returned():
    """The shift is that of the part that moves most, wherever it is."""
    for x0, y0 in ((40.0, 40.0), (280.0, 200.0), (280.0, 40.0)):
        first, second = (streak(0.0, 0.1 * k) + streak(0.0, 0.5 * k, x0, y0) for k in (0, 1))
        assert image_shift(first, second) == pytest.approx(0.5, rel=0.1)


def test_blocks_without_structure_are_ignored():
    """Flicker of a plain wall is no motion. Noise that exceeds the structure is no certain motion."""
    plain = np.full((240, 320), 100, dtype=np.uint8)
    assert image_shift(plain, plain + np.uint8(3)) == 0
    noisy = [100 + np.random.default_rng(k).normal(0, 4, (240, 320)) for k in range(2)]
    assert image_shift(*(levels.astype(np.uint8) for levels in noisy)) == 0


def test_blocks_have_at_least_forty_pixels():
    """As many whole blocks as fit are used, one in a small image. The remaining borders are ignored."""
    levels = np.arange(85.0 * 130).reshape(85, 130).astype(np.float32)
    sums = _block_sums(levels)
    assert sums.shape == (2, 3)
    assert sums[1, 2] == levels[42:84, 86:129].sum(dtype=np.float64)
    assert _block_sums(levels[:20, :30]).shape == (1, 1)
    assert _block_sums(levels[:80, :120]).shape == (2, 3)
    assert _block_sums(levels[:79, :119]).shape == (1, 2)


def test_images_are_halved():
    assert reduce_image(np.zeros((240, 320), dtype=np.uint8)).shape == (120, 160)
