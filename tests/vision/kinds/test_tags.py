"""Tags in images that are not as they should be."""

from __future__ import annotations

import pytest

from basecal.vision.draw.render import RenderSettings
from basecal.vision.kinds.tags import detect
from vision_scenes import DARK, TARGETS, check_poor_image, scene

SHAPE = TARGETS["tags"]
POOR = {
    "as they should be": (RenderSettings(), 1, 24),
    "dark": (DARK, 1, 22),
    "blurred": (RenderSettings(blur_px=6.0, noise=1.0), 1, 4),
    "small": (RenderSettings(), 5, 24),
}


@pytest.mark.parametrize("how", list(POOR))
def test_poor_images(how: str) -> None:
    """Found where dark, blurred or small, with sigmas true within a factor of two and a half."""
    check_poor_image(detect, SHAPE, *POOR[how])


def test_tags_of_another_family() -> None:
    """Tags of another family, and a target without tags, give nothing."""
    assert detect(scene(SHAPE), TARGETS["aruco"]) is None
    assert detect(scene(SHAPE), TARGETS["chessboard"]) is None
