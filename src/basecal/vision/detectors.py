"""How a target is found in an image."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np

from basecal.cell.target import Finder, Target
from basecal.errors import InputError
from basecal.vision import survey
from basecal.vision.detection import Detection, Image, check_image, eight_bit
from basecal.vision.kinds import charuco, chessboard, circles, led, tags
from basecal.vision.kinds.ways import Grey

LIGHT: Finder = "light"
"""The one way of finding that makes use of an image without the target."""

_LEAST_SIDE_PX = 16  # the smallest image that OpenCV's detectors search without an error of their own

Detector = Callable[[Image, Target], Detection | None]
"""Finds a target in an image, (h, w) of uint8 or uint16; None if it is not seen."""

DETECTORS: dict[Finder, Detector] = {
    "charuco": charuco.detect,
    "chessboard": chessboard.detect,
    "circles": circles.detect,
    "tags": tags.detect,
    LIGHT: led.detect,
}
"""One line a way of finding; a target without one is not found in images."""

_HANDED: tuple[Finder, ...] = ("charuco", "tags")  # found in no mirrored image

Survey = Callable[[list[Grey], Target], str | None]
"""What is in images instead of a target, as the end of a sentence; None if nothing is known."""

SURVEYS: dict[Finder, Survey] = {
    "tags": survey.other_tags,
    "charuco": survey.other_charuco,
    "chessboard": survey.other_chessboard,
    "circles": survey.other_circles,
}
"""One line a way of finding that knows what else there may be."""


def find(image: Image, target: Target, background: Image | None = None) -> Detection | None:
    """A target in an image, or None; only a light makes use of a `background`, the image without it.

    Raises:
        InputError: if the image is not grey of 8 or 16 bits, or the target cannot be detected as described.
    """
    check_image(image)
    if target.found_by is None:
        raise InputError(f"a target of kind {target.kind!r} is not found in images")
    if min(image.shape) < _LEAST_SIDE_PX:
        return None
    if target.found_by == LIGHT:
        return led.detect(image, target, background)
    return DETECTORS[target.found_by](image, target)


def describe_other_targets(images: Iterable[Image], target: Target) -> str | None:
    """Content of the images instead of a target, as the end of a sentence; None if nothing is known.

    Args:
        images: A few in which the target is not found, (h, w) each.
        target: What was looked for.
    """
    grey = [eight_bit(image) for image in images]
    look = None if target.found_by is None else SURVEYS.get(target.found_by)
    if sum(find(np.fliplr(image), target) is not None for image in grey if target.found_by in _HANDED) > len(grey) / 2:
        return "the images are mirrored: switch mirroring off in the camera's program, and take them again"
    other = survey.describe_repeats(grey, target) or (look(grey, target) if look else None)
    return other or survey.describe_darkness(grey) or survey.describe_blur(grey)
