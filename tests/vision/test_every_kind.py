"""What holds in images of every kind of target, a new one among them."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.cell.target import Target
from basecal.cell.targets.registry import TARGETS, TargetKindName
from basecal.geometry import SE3, Array
from basecal.vision.detectors import find
from basecal.vision.draw.light import render_light
from basecal.vision.draw.render import render
from vision_scenes import WIDE


def seen_from_the_front(shape: Target) -> SE3:
    """Half a metre ahead of a camera and not quite upright."""
    front = shape.sheets[0].target_from_sheet.rotation if shape.sheets else np.eye(3)
    rotation = SE3.from_rpy((0.2, -0.15, 0.3), np.zeros(3)).rotation @ front.T
    return SE3(rotation, np.array([0.01, 0.02, 0.5]) - rotation @ shape.points.mean(axis=0))


def nearest_reading(shape: Target, error: Array, back: Array) -> Array:
    return min((error, back), key=lambda each: float(np.abs(each).max())) if shape.alike_turned else error


@pytest.mark.parametrize("kind", TARGETS)
def test_found_where_it_is_drawn(kind: TargetKindName) -> None:
    """Every point of a usual target is found in its image within 0.1 px, under its own id."""
    shape = TARGETS[kind].usual(np.random.default_rng(0))
    if shape.found_by is None:
        return
    pose = seen_from_the_front(shape)
    image = render(WIDE, shape, pose) if shape.sheets else render_light(WIDE, pose @ shape.points)
    detection = find(image, shape)
    assert detection is not None
    np.testing.assert_array_equal(detection.ids, shape.ids)
    true = WIDE.project(pose @ shape.points)
    error = nearest_reading(shape, detection.pixels - true, detection.pixels - true[::-1])
    assert np.abs(error).max() < 0.1
