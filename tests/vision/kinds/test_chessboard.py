"""Chessboards in images that are not as they should be."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.cell.targets.chessboard import chessboard_target
from basecal.geometry import SE3
from basecal.vision.draw.render import RenderSettings
from basecal.vision.kinds import chessboard
from basecal.vision.kinds.chessboard import detect
from vision_scenes import DARK, TARGETS, check_poor_image, scene, shrunk

SHAPE = TARGETS["chessboard"]
POOR = {
    "as they should be": (RenderSettings(), 1, 54),
    "dark": (DARK, 1, 54),
    "blurred": (RenderSettings(blur_px=5.0, noise=1.0), 1, 54),
    "small": (RenderSettings(), 8, 40),
}


@pytest.mark.parametrize("how", list(POOR))
def test_poor_images(how: str) -> None:
    """Found where dark, blurred or small, with sigmas true within a factor of two and a half."""
    check_poor_image(detect, SHAPE, *POOR[how])


def test_less_than_a_board() -> None:
    """A board with fewer squares than stated is none."""
    image = shrunk(scene(SHAPE), 2)
    assert detect(image, SHAPE) is not None
    assert detect(image, chessboard_target((10, 7), 0.03)) is None


def test_no_corner_is_lost_by_the_smaller_image(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leaning so far that some corners are lost at half the size, a board is sought at its own."""
    rotation = SE3.from_rpy((-0.707, 0.565, 1.723), np.zeros(3)).rotation
    image = scene(SHAPE, RenderSettings(blur_px=2.0, noise=1.0), SE3(rotation, np.array([0.05, 0.0, 0.42])))
    ways, counts = chessboard._PREPROCESSINGS, []
    for some in (ways[:1], ways[2:], ways):
        monkeypatch.setattr(chessboard, "_PREPROCESSINGS", some)
        found = detect(image, SHAPE)
        assert found is not None
        counts.append(len(found.pixels))
    half, own, both = counts
    assert half < own == both
