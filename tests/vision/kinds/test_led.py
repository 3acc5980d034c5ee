"""Tests of the detection of LEDs, against the Cramer-Rao bound of their photons."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from basecal.cell.targets.led import led_target
from basecal.errors import InputError
from basecal.geometry import Array
from basecal.vision.draw.led import LedSettings, led_levels, render_led
from basecal.vision.fit.spot_fit import Spot
from basecal.vision.kinds.led import _bright_spots, _fit_rough_spot, _RoughSpot, detect
from quick import quick
from vision_scenes import SMALL as PLAIN

LIGHT = led_target()
OFF = {"photons": 0.0}


def make_exposure(photons: float, spot: float) -> LedSettings:
    """Settings of an LED whose brightest pixel has about 170 of 255 levels."""
    return LedSettings(photons, spot, photons / (2 * np.pi * (spot**2 + 1 / 12) * 160))


def places(count: int, seed: int = 0) -> Array:
    rng = np.random.default_rng(seed)
    return np.column_stack([rng.uniform(-0.15, 0.15, count), rng.uniform(-0.1, 0.1, count), np.ones(count)])


def bound(settings: LedSettings, place: Array, pair: bool) -> float:
    """Cramer-Rao bound per coordinate [px] with unknown position, width, brightness and background."""
    step = 1e-4
    shifts = [np.zeros(3), np.array([step, 0, 0]), np.array([0, step, 0])]
    at, right, down = (led_levels(PLAIN, place + shift, settings).ravel() for shift in shifts)
    wider = led_levels(PLAIN, place, replace(settings, spot_px=settings.spot_px + step)).ravel()
    moved = [(right - at) / (500 * step), (down - at) / (500 * step), (wider - at) / step]
    columns = [*moved, at - settings.background, np.ones_like(at)]
    variance = settings.read_noise**2 + 1 / 12 + at / settings.photons_per_level
    if pair:
        variance = variance + settings.read_noise**2 + 1 / 12 + settings.background / settings.photons_per_level
    jacobian = np.stack(columns, axis=1)
    covariance = np.linalg.inv((jacobian / variance[:, None]).T @ jacobian)
    return float(np.sqrt((covariance[0, 0] + covariance[1, 1]) / 2))


def errors(settings: LedSettings, count: int, pair: bool) -> tuple[Array, Array]:
    """Errors, (n, 2), and sigmas, (n,), [px]."""
    error, sigma = [], []
    for index, place in enumerate(places(count)):
        off = render_led(PLAIN, place, replace(settings, **OFF), 2 * index + 1) if pair else None
        found = detect(render_led(PLAIN, place, settings, 2 * index), LIGHT, off)
        assert found is not None
        assert found.ids is not None
        error.append(found.pixels[0] - PLAIN.project(place))
        sigma.append(found.sigma_px[0])
    return np.array(error), np.array(sigma)


@pytest.mark.journey
@pytest.mark.parametrize("pair", [False, True], ids=["single", "pair"])
@pytest.mark.parametrize("spot", quick([0.8, 1.5], [1.5]))
@pytest.mark.parametrize("photons", [3e3, 3e5])
def test_led_detection_reaches_cramer_rao_bound(photons: float, spot: float, pair: bool) -> None:
    """The error is at the Cramer-Rao bound of the image, or of both images of a pair, and the sigma agrees with it."""
    settings = make_exposure(photons, spot)
    error, sigma = errors(settings, 40, pair)
    efficiency = np.sqrt(np.mean(error**2)) / bound(settings, places(1)[0], pair)
    # The rms of 80 coordinates has a sigma of 8 %: 1.1 plus two of them is 1.25.
    assert 0.8 < efficiency < 1.25
    # Sigmas have a floor, which makes them a sixth larger for 300,000 photons in a small spot.
    assert 0.7 < np.sqrt(np.mean((error / sigma[:, None]) ** 2)) < 1.25


@pytest.mark.journey
def test_saturated_led_is_unbiased() -> None:
    """The flanks of an LED whose centre is saturated determine its position without bias."""
    settings = replace(make_exposure(3e5, 2.0), photons_per_level=make_exposure(3e5, 2.0).photons_per_level / 3)
    error, sigma = errors(settings, 40, pair=False)
    assert np.sqrt(np.mean(error**2)) < 0.02
    assert np.all(np.abs(error.mean(axis=0)) < 4 * error.std() / np.sqrt(len(error)))
    assert np.sqrt(np.mean((error / sigma[:, None]) ** 2)) == pytest.approx(1.0, abs=0.3)


def test_candidates_are_sorted_by_brightness() -> None:
    """Several bright spots are all returned, without ids, the brightest first."""
    spots = places(3, seed=1)
    levels = sum(
        led_levels(PLAIN, spot, replace(make_exposure(3e4, 1.5), photons=photons, background=3.0))
        for spot, photons in zip(spots, (1.4e4, 3e4, 2e4), strict=True)
    )
    noisy = levels + np.random.default_rng(0).normal(0, 1, levels.shape)
    found = detect(np.clip(np.rint(noisy), 0, 255).astype(np.uint8), LIGHT)
    assert found is not None
    assert found.ids is None
    np.testing.assert_allclose(found.pixels, PLAIN.project(spots[[1, 2, 0]]), atol=0.1)


def test_constant_lamp_is_not_the_led() -> None:
    """A brighter spot that is also visible with the LED off is not the LED."""
    settings, (light, lamp) = make_exposure(3e4, 1.5), places(2, seed=2)
    both = render_led(PLAIN, np.stack([light, lamp]), settings, 1)
    only_lamp = render_led(PLAIN, lamp, settings, 2)
    alone, pair = detect(both, LIGHT), detect(both, LIGHT, only_lamp)
    assert alone is not None
    assert pair is not None
    assert (len(alone.pixels), len(pair.pixels)) == (2, 1)
    np.testing.assert_allclose(pair.pixels[0], PLAIN.project(light), atol=0.05)


def test_led_is_detected_on_structured_scene() -> None:
    """An LED on a structured scene is detected in the difference of on and off."""
    settings = replace(make_exposure(3e4, 1.2), background=60.0, texture=25.0, photons=1e4)
    place = places(1, seed=3)[0]
    on, off = (render_led(PLAIN, place, each, seed) for seed, each in enumerate((settings, replace(settings, **OFF))))
    found = detect(on, LIGHT, off)
    assert found is not None
    np.testing.assert_allclose(found.pixels[0], PLAIN.project(place), atol=0.15)


def test_led_at_the_border_is_detected() -> None:
    """The visible part of an LED at the border determines its position."""
    place = np.array([-0.3184, 0.1, 1.0])  # pixel 0.3
    found = detect(render_led(PLAIN, place, make_exposure(1e5, 1.5)), LIGHT)
    assert found is not None
    np.testing.assert_allclose(found.pixels[0], PLAIN.project(place), atol=0.05)


def test_dark_images_have_no_led() -> None:
    """No LED is detected in the dark, in noise, or if on and off are equal."""
    dark = render_led(PLAIN, places(1)[0], LedSettings(photons=0.0))
    assert detect(np.zeros((100, 100), np.uint8), LIGHT) is None
    assert detect(dark, LIGHT, dark) is None


@pytest.mark.parametrize(("radius", "slant"), [(2, 7), (3, 7), (7, 5)])
def test_saturated_disc_with_streak_is_no_spot(radius: int, slant: int) -> None:
    """A saturated disc without any usable level is no spot of any width, and does not stop the search."""
    image = np.full((96, 128), 20, dtype=np.uint8)
    cv2.circle(image, (60, 40), radius, 255, -1)
    cv2.line(image, (60, 40 + radius), (60 + slant, 60), 180, 1)
    found = detect(image, LIGHT)
    assert found is None or np.linalg.norm(found.pixels[0] - [60, 40]) > radius


def test_several_simultaneous_leds_are_not_detected() -> None:
    """Several LEDs at once give no detection, because their identities are unknown."""
    two = led_target([[0, 0, 0], [0.1, 0, 0]])
    assert detect(render_led(PLAIN, places(2), make_exposure(3e4, 1.5)), two) is None


def test_background_of_other_size_is_refused() -> None:
    """A background image of another size is an input error."""
    with pytest.raises(InputError, match="differs in size"):
        detect(np.zeros((50, 50), np.uint8), LIGHT, np.zeros((50, 40), np.uint8))


def gaussians(*spots: tuple[float, float, float, float], shape: tuple[int, int] = (120, 160)) -> Array:
    """Levels of spots on black: x, y, height and sigma [px]."""
    rows, columns = np.indices(shape)
    levels = np.zeros(shape)
    for x, y, height, sigma in spots:
        levels += height * np.exp(-0.5 * ((columns - x) ** 2 + (rows - y) ** 2) / sigma**2)
    return np.rint(levels).astype(np.uint16)


def test_bright_spots_have_rough_position_and_width() -> None:
    """The position is accurate to a pixel. A Gaussian is 3.3 sigmas wide at a quarter of its height."""
    for x, y, sigma in ((50.3, 40.8, 2.0), (101.0, 77.5, 4.0)):
        (place,) = _bright_spots(gaussians((x, y, 4000, sigma)))
        assert (place.x, place.y) == (pytest.approx(x, abs=1.1), pytest.approx(y, abs=1.1))
        assert place.extent == pytest.approx(3.3 * sigma, abs=2.5)


@pytest.mark.parametrize(("height", "count"), [(1200, 2), (800, 1)])
def test_spot_requires_quarter_of_brightest_height(height: int, count: int) -> None:
    assert len(_bright_spots(gaussians((40, 60, 4000, 2.0), (110, 60, height, 2.0)))) == count


def test_faint_spot_in_an_image_without_noise_is_found() -> None:
    """On a uniform background a spot of four levels is enough."""
    (place,) = _bright_spots(100 + gaussians((50.3, 40.8, 4, 3.0)))
    assert (place.x, place.y) == (pytest.approx(50.3, abs=1.1), pytest.approx(40.8, abs=1.1))


@pytest.mark.parametrize(("side", "count"), [(44, 1), (56, 0)])
def test_large_bright_areas_are_not_spots(side: int, count: int) -> None:
    """Windows and walls are too large for a spot."""
    for wide, high in ((side, side), (side, 20), (20, side)):
        image = np.zeros((120, 160), np.uint16)
        image[20 : 20 + high, 30 : 30 + wide] = 4000
        assert len(_bright_spots(image)) == count


def test_eight_brightest_spots_are_candidates() -> None:
    """All of eight spots are candidates; of ten the two darkest are omitted."""
    every = [(16 + 32 * (k % 5), 20 + 36 * (k // 5), 2000 + 200 * k, 2.0) for k in range(10)]
    assert len(_bright_spots(gaussians(*every[:8]))) == 8
    found = _bright_spots(gaussians(*every))
    assert {(round(place.x / 32 - 0.5), round((place.y - 20) / 36)) for place in found} == {
        (k % 5, k // 5) for k in range(2, 10)
    }


def test_noise_has_no_spots() -> None:
    """Noise and a uniform wall have no spots; a spot more than six sigmas above the noise is one."""
    noise = np.random.default_rng(0).normal(1000, 40, (480, 640))
    assert _bright_spots(noise.astype(np.uint16)) == []
    assert _bright_spots(np.full((120, 160), 1000, np.uint16)) == []
    assert len(_bright_spots((noise + gaussians((300, 200, 400, 2.0), shape=(480, 640))).astype(np.uint16))) == 1


def fit_spot_at(image: Array, x: float, y: float, extent: float, background: Array | None = None) -> Spot | None:
    return _fit_rough_spot(image, background, 65535.0, _RoughSpot(x, y, extent))


def test_spot_is_fitted_at_any_place_in_the_image() -> None:
    """A spot is fitted beside the border as well, and from a start a pixel away. A background is subtracted."""
    for x, y in ((80.3, 60.8), (1.4, 2.6), (157.6, 118.2)):
        image = gaussians((x, y, 30000, 2.0))
        background = np.full_like(image, 500)
        for found in (fit_spot_at(image, x + 0.7, y - 0.6, 7), fit_spot_at(image + background, x, y, 7, background)):
            assert found is not None
            assert (found.x, found.y) == (pytest.approx(x, abs=2e-3), pytest.approx(y, abs=2e-3))


@pytest.mark.parametrize(("sigma", "fits"), [(0.05, False), (0.6, True), (12.0, True), (20.0, False)])
def test_spot_width_is_limited(sigma: float, fits: bool) -> None:
    """The widths of a hot pixel and of a window are refused."""
    image = gaussians((80.0, 60.0, 30000, sigma))
    assert (fit_spot_at(image, 80.0, 60.0, max(3.3 * sigma, 1.0)) is not None) == fits


def test_dark_or_distant_spot_is_refused() -> None:
    """A dark spot, or one far from the start of the search, is refused."""
    dark = (40000 - gaussians((80.0, 60.0, 30000, 2.0))).astype(np.uint16)
    assert fit_spot_at(dark, 80.0, 60.0, 7) is None
    assert fit_spot_at(gaussians((92.0, 60.0, 30000, 2.0)), 80.0, 60.0, 7) is None
