"""Tests of detection in images of every registered kind of target."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.cell.target import Target
from basecal.cell.targets.registry import TARGETS, TargetKindName
from basecal.geometry import SE3, Array, Camera
from basecal.vision.detectors import find_target
from basecal.vision.draw.led import render_led
from basecal.vision.draw.render import RenderSettings, render
from vision_scenes import PLAIN, WIDE


def seen_from_the_front(shape: Target) -> SE3:
    """Pose half a metre in front of a camera, slightly tilted."""
    front = shape.sheets[0].target_from_sheet.rotation if shape.sheets else np.eye(3)
    rotation = SE3.from_rpy((0.2, -0.15, 0.3), np.zeros(3)).rotation @ front.T
    return SE3(rotation, np.array([0.01, 0.02, 0.5]) - rotation @ shape.points.mean(axis=0))


def nearest_reading(shape: Target, error: Array, back: Array) -> Array:
    return min((error, back), key=lambda each: float(np.abs(each).max())) if shape.has_half_turn_symmetry else error


@pytest.mark.journey
@pytest.mark.parametrize("kind", TARGETS)
def test_every_target_kind_is_detected(kind: TargetKindName) -> None:
    """Every point of a typical target is found in its image within 0.1 px, under its own id."""
    shape = TARGETS[kind].usual(np.random.default_rng(0))
    if shape.found_by is None:
        return
    pose = seen_from_the_front(shape)
    image = render(WIDE, shape, pose) if shape.sheets else render_led(WIDE, pose @ shape.points)
    detection = find_target(image, shape)
    assert detection is not None
    np.testing.assert_array_equal(detection.ids, shape.ids)
    true = WIDE.project(pose @ shape.points)
    error = nearest_reading(shape, detection.pixels - true, detection.pixels - true[::-1])
    assert np.abs(error).max() < 0.1


@pytest.mark.journey
@pytest.mark.parametrize("kind", TARGETS)
@pytest.mark.parametrize("levels", [{}, {"black": 0.0, "white": 255.0, "background": 255.0}])
@pytest.mark.parametrize("lens", [PLAIN, WIDE])
def test_frontal_sharp_target_is_within_sigma(kind: TargetKindName, levels: dict[str, float], lens: Camera) -> None:
    """The points of a frontal render along the pixel grid, without blur and noise, are found within their sigmas.

    Centres of discs are means over many edges and may be off by some thousandths of a pixel more.
    """
    shape = TARGETS[kind].usual(np.random.default_rng(0))
    if shape.found_by is None or not shape.sheets:
        return
    rotation = shape.sheets[0].target_from_sheet.rotation.T
    pose = SE3(rotation, np.array([0.003, 0.002, 0.5]) - rotation @ shape.points.mean(axis=0))
    detection = find_target(render(lens, shape, pose, RenderSettings(blur_px=0.0, noise=0.0, **levels)), shape)
    assert detection is not None
    assert detection.ids is not None
    assert len(detection.ids) >= 0.75 * len(shape.ids)
    true = lens.project(pose @ shape.points)
    rows = shape.rows(detection.ids)
    error = nearest_reading(shape, detection.pixels - true[rows], detection.pixels - true[::-1][rows])
    assert np.all(np.abs(error) < 4 * np.hypot(detection.sigma_px, 0.003)[:, None])
