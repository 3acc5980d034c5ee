"""The detectors of targets in images, for each kind of search."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np

from basecal.cell.target import Finder, Target
from basecal.errors import InputError
from basecal.vision import survey
from basecal.vision.detection import Detection, Image, check_image, eight_bit
from basecal.vision.kinds import charuco, chessboard, circles, led, tags
from basecal.vision.kinds.preprocessing import Grey

LED: Finder = "led"
"""The only detector that uses a background image, taken with the LED off."""

_LEAST_SIDE_PX = 16  # side of the smallest image that OpenCV's detectors accept

Detector = Callable[[Image, Target], Detection | None]
"""Function that finds a target in an image, (h, w) of uint8 or uint16; it returns None if the target is not found."""

DETECTORS: dict[Finder, Detector] = {
    "charuco": charuco.detect,
    "chessboard": chessboard.detect,
    "circles": circles.detect,
    "tags": tags.detect,
    LED: led.detect,
}
"""Detectors for each `found_by`; a target without one is not found in images."""

_HANDED: tuple[Finder, ...] = ("charuco", "tags")  # not found in mirrored images

Survey = Callable[[list[Grey], Target], str | None]
"""Function that describes the content of images without a target, as the end of a sentence; None if unknown."""

SURVEYS: dict[Finder, Survey] = {
    "tags": survey.other_tags,
    "charuco": survey.other_charuco,
    "chessboard": survey.other_chessboard,
    "circles": survey.other_circles,
}
"""Diagnoses for each `found_by` that has one."""


def find_target(image: Image, target: Target, background: Image | None = None) -> Detection | None:
    """Find a target in an image, or return None; only LEDs use `background`, the image with the LED off.

    Raises:
        InputError: if the image is not grey of 8 or 16 bits, or the target cannot be detected as described.
    """
    check_image(image)
    if target.found_by is None:
        raise InputError(f"a target of kind {target.kind!r} is not found in images")
    if min(image.shape) < _LEAST_SIDE_PX:
        return None
    if target.found_by == LED:
        return led.detect(image, target, background)
    return DETECTORS[target.found_by](image, target)


def describe_other_targets(images: Iterable[Image], target: Target) -> str | None:
    """Describe the content of images without the target, as the end of a sentence; None if unknown.

    Args:
        images: A few images in which the target is not found, (h, w) each.
        target: The target that was not found.
    """
    grey = [eight_bit(image) for image in images]
    describe = None if target.found_by is None else SURVEYS.get(target.found_by)
    mirrored = [np.fliplr(image) for image in grey if target.found_by in _HANDED]
    if sum(find_target(image, target) is not None for image in mirrored) > len(grey) / 2:
        return "the images are mirrored: switch mirroring off in the camera's program, and take them again"
    other = survey.describe_repeats(grey, target) or (describe(grey, target) if describe else None)
    return other or survey.describe_darkness(grey) or survey.describe_blur(grey)
