"""How a target of each kind is found in an image."""

from __future__ import annotations

from collections.abc import Callable

from basecal.cell.target import Kind, Target
from basecal.vision.detection import Detection, Image, checked
from basecal.vision.kinds import apriltag, charuco, chessboard, circles, led

_LEAST_SIDE = 16

Detector = Callable[[Image, Target], Detection | None]
"""Finds a target in an image, (h, w) of uint8 or uint16; None where it is not seen."""

DETECTORS: dict[Kind, Detector] = {
    "charuco": charuco.detect,
    "chessboard": chessboard.detect,
    "circles": circles.detect,
    "apriltag": apriltag.detect,
    "led": led.detect,
}
"""One line a kind; a kind that is not here is not found in images."""


def find(image: Image, target: Target, background: Image | None = None) -> Detection | None:
    """A target in an image, or None; only a light makes use of a `background`, the image without it.

    Raises:
        InputError: if the image is not grey of 8 or 16 bits, or the target cannot be detected as described.
    """
    checked(image)
    if min(image.shape) < _LEAST_SIDE:
        return None
    if target.kind == "led":
        return led.detect(image, target, background)
    return DETECTORS[target.kind](image, target)
