"""Tests of the detection of chessboards in poor images."""

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


@pytest.mark.journey
@pytest.mark.parametrize("how", list(POOR))
def test_chessboard_is_detected_in_poor_images(how: str) -> None:
    """A dark, blurred or small board is detected, with sigmas true within a factor of two and a half."""
    check_poor_image(detect, SHAPE, *POOR[how])


@pytest.mark.journey
def test_smaller_board_is_not_detected() -> None:
    """A board with fewer squares than stated is not detected."""
    image = shrunk(scene(SHAPE), 2)
    assert detect(image, SHAPE) is not None
    assert detect(image, chessboard_target((10, 7), 0.03)) is None


@pytest.mark.journey
def test_tilted_board_is_searched_at_full_size(monkeypatch: pytest.MonkeyPatch) -> None:
    """A board tilted so far that some corners are lost at half the size is searched at full size as well."""
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
