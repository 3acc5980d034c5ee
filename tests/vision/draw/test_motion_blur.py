"""Levels smeared along a line."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.vision.draw.motion_blur import blur_motion


@pytest.mark.parametrize("way", [(6.0, 0.0), (0.0, 4.5), (3.0, -5.0)])
def test_a_point_becomes_a_line(way):
    """Its light stays as much and in the same place, and spreads as a line of that length: variance L^2 / 12."""
    image = np.zeros((41, 41))
    image[20, 20] = 100.0
    out = blur_motion(image, np.array(way))
    v, u = np.mgrid[:41, :41]
    weights = out / out.sum()
    assert out.sum() == pytest.approx(100.0)
    assert (weights * u).sum() == pytest.approx(20.0, abs=0.01)
    along = ((u - 20) * way[0] + (v - 20) * way[1]) / np.hypot(*way)
    # Sharing between pixels adds up to a quarter.
    assert (weights * along**2).sum() == pytest.approx(np.hypot(*way) ** 2 / 12, abs=0.3)


def test_what_stands_still_is_left_alone():
    """A way of less than a fiftieth of a pixel changes nothing, not even the array."""
    image = np.arange(12.0).reshape(3, 4)
    assert blur_motion(image, np.array([0.01, 0.0])) is image
