"""Tests of the images of a camera of a running cell."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from basecal.cell.targets.led import led_target
from basecal.geometry import SE3, Camera
from basecal.simulation.running.images import CameraScene, CameraView
from basecal.vision.draw.led import LedSettings
from shared.facing_arms import facing_arms

LENS = Camera("pinhole", np.array([500.0, 500, 159.5, 119.5]), (320, 240))
LIGHT = CameraScene(led_target(), SE3(np.eye(3), np.array([0.0, 0.0, 1.0])), np.array([[0.0, 0.1, 1.0]]))


def brightest(image):
    return tuple(int(k) for k in np.unravel_index(np.argmax(image), image.shape)[::-1])


def test_led_is_visible_only_when_on():
    """The LED is at its projection while it is on, and invisible when it is off."""
    view = CameraView(LENS, 0.0)
    lit = view.image(lambda at: LIGHT, 0.0, 0.01, True, 1)
    dark = view.image(lambda at: LIGHT, 0.0, 0.01, False, 2)
    assert brightest(lit) in {(159, 119), (160, 120), (159, 120), (160, 119)}
    assert int(lit.max()) > 100 > 40 > int(dark.max())


def test_table_reflects_the_led():
    """The reflection is at the mirrored point, weaker by its share."""
    plain, mirrored = (
        CameraView(LENS, share).image(lambda at: LIGHT, 0.0, 0.01, True, 1).astype(float) for share in (0.0, 0.4)
    )
    more = (mirrored - plain)[155:185, 145:175].sum()
    light = LedSettings().photons / LedSettings().photons_per_level
    assert more / light == pytest.approx(0.4, abs=0.15)  # noise of 900 pixels twice: 0.04


def test_reflection_moves_independently_of_led():
    """If both arms move rigidly together, the camera sees the LED unchanged, and another reflection."""
    view = CameraView(LENS, 0.4)
    first, second = (
        view.image(lambda at, y=y: replace(LIGHT, reflected=np.array([[0.0, y, 1.0]])), 0.0, 0.01, True, 1)
        for y in (0.1, -0.1)
    )
    assert int(first[165:175].max()) > 30 > int(first[65:75].max())
    assert int(second[65:75].max()) > 30 > int(second[165:175].max())


def test_moving_led_is_blurred():
    """An LED that moves 10 mm (5 px) during the exposure is wider along its path, and centred on it."""

    def seen(at):
        return replace(LIGHT, camera_from_target=SE3(np.eye(3), np.array([at, 0.0, 1.0])))

    image = CameraView(LENS, 0.0).image(seen, -0.005, 0.01, True, 1).astype(float) - 10
    v, u = np.mgrid[:240, :320]
    near = (np.abs(u - 159.5) < 12) & (np.abs(v - 119.5) < 12)
    weights = np.where(near, np.maximum(image, 0), 0)
    mean = [(weights * axis).sum() / weights.sum() for axis in (u, v)]
    spread = [
        np.sqrt((weights * (axis - at) ** 2).sum() / weights.sum()) for axis, at in zip((u, v), mean, strict=True)
    ]
    assert abs(mean[0] - 159.5) < 0.3
    assert spread[0] > 1.15 * spread[1]


def test_each_image_has_new_noise():
    """Two images of the same board differ by noise of some levels, and no more."""
    world = facing_arms()
    board = world.cell.targets["board"].target
    seen = CameraScene(board, SE3(np.diag([1.0, 1, 1]), np.array([-0.1, -0.1, 0.6])), np.zeros((0, 3)))
    view = CameraView(world.lenses["wrist"], 0.0)
    first, second = (view.image(lambda at: seen, 0.0, 0.01, True, seed).astype(float) for seed in (1, 2))
    assert 2.0 < np.std(first - second) < 4.0
