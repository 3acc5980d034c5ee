"""Tests of rendered LEDs."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.errors import InputError
from basecal.geometry import Camera
from basecal.vision.draw.led import LedSettings, led_levels, render_led
from vision_scenes import SMALL

PLACE = np.array([0.0213, -0.017, 1.0])


def test_photons_are_at_the_projection() -> None:
    """All photons of an LED are in the image, and their centroid is its projection."""
    settings = LedSettings(photons=2e4, spot_px=1.5, photons_per_level=10)
    spot = led_levels(SMALL, PLACE, settings) - settings.background
    rows, columns = np.indices(spot.shape)
    assert spot.sum() == pytest.approx(2000, rel=1e-12)
    middle = [(spot * each).sum() / spot.sum() for each in (columns, rows)]
    np.testing.assert_allclose(middle, SMALL.project(PLACE), atol=1e-9)


def test_spot_has_stated_width() -> None:
    """The variance of a spot is that of its setting and of the pixel's square."""
    settings = LedSettings(photons=1e4, spot_px=2.0, photons_per_level=1)
    spot = led_levels(SMALL, PLACE, settings) - settings.background
    columns = np.arange(spot.shape[1])
    across = spot.sum(axis=0) / spot.sum()
    assert across @ (columns - across @ columns) ** 2 == pytest.approx(2.0**2 + 1 / 12, rel=1e-6)


def test_noise_is_shot_and_read_noise() -> None:
    """The variance of a level is the sum of shot noise, read noise and rounding."""
    settings = LedSettings(photons=0.0, background=50.0, photons_per_level=4.0, read_noise=1.5)
    image = render_led(SMALL, np.zeros((0, 3)), settings).astype(float)
    # 76800 pixels determine a variance within 0.5 %.
    assert image.var() == pytest.approx(50 / 4 + 1.5**2 + 1 / 12, rel=0.03)
    assert image.mean() == pytest.approx(50, abs=0.1)


def test_leds_outside_of_image_have_no_effect() -> None:
    """LEDs behind the camera or outside of the image have no effect.

    One that is too bright is clipped at the highest level.
    """
    settings = LedSettings(read_noise=0.0, background=0.0)
    for point in ([0, 0, -1.0], [5.0, 0, 1.0]):
        assert not render_led(SMALL, np.array([point]), settings).any()
    bright = render_led(SMALL, PLACE, LedSettings(photons=1e7))
    assert bright.max() == 255
    assert np.array_equal(bright, render_led(SMALL, PLACE, LedSettings(photons=1e7)))
    assert not np.array_equal(bright, render_led(SMALL, PLACE, LedSettings(photons=1e7), seed=1))


def test_camera_without_size_is_refused() -> None:
    """A camera without an image size has no image."""
    with pytest.raises(InputError, match="size"):
        render_led(Camera("pinhole", SMALL.parameters), PLACE)


def at_pixel(u: float, v: float) -> np.ndarray:
    """Point about a metre away that projects to a pixel."""
    return SMALL.undistort(np.array([[u, v]]))[0]


def test_default_exposure_of_led() -> None:
    """30,000 photons make 1500 levels over a dark background of ten, in a spot of 1.2 px and its pixel."""
    levels = led_levels(SMALL, PLACE, LedSettings())
    assert levels[0, 0] == 10
    spot = levels - 10
    assert spot.sum() == pytest.approx(1500)
    columns, across = np.arange(spot.shape[1]), spot.sum(axis=0) / spot.sum()
    assert across @ (columns - across @ columns) ** 2 == pytest.approx(1.2**2 + 1 / 12, rel=1e-6)
    image = render_led(SMALL, np.zeros((0, 3)))
    assert image.dtype == np.uint8
    assert image.astype(float).var() == pytest.approx(10 / 20 + 1 + 1 / 12, rel=0.03)
    np.testing.assert_array_equal(image, render_led(SMALL, np.zeros((0, 3)), LedSettings(), seed=0))


@pytest.mark.parametrize("corner", [(0, 0), (1, 0), (0, 1), (1, 1)])
def test_led_on_image_corner_is_a_quarter_visible(corner: tuple[int, int]) -> None:
    """The first and the last row and column have their share of the photons."""
    u, v = np.array(corner) * SMALL.size_px - 0.5
    settings = LedSettings(background=0.0)
    levels = led_levels(SMALL, at_pixel(u, v), settings)
    assert levels.sum() == pytest.approx(1500 / 4, rel=1e-6)
    assert np.unravel_index(levels.argmax(), levels.shape) == (
        corner[1] * (SMALL.size_px[1] - 1),
        corner[0] * (SMALL.size_px[0] - 1),
    )


def test_texture_belongs_to_the_scene() -> None:
    """Images with different noise have the same texture; another scene has another one."""
    one, other = (led_levels(SMALL, PLACE, LedSettings(texture=3.0, scene=scene)) for scene in (0, 1))
    np.testing.assert_array_equal(one, led_levels(SMALL, PLACE, LedSettings(texture=3.0)))
    assert np.abs(one - other).max() > 1


def test_leds_add_up() -> None:
    """Two LEDs at one position give twice the levels above the background."""
    once, twice = (led_levels(SMALL, np.array([PLACE] * count), LedSettings()) for count in (1, 2))
    np.testing.assert_allclose(twice - 10, 2 * (once - 10), atol=1e-9)
