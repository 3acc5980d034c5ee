"""Ways to search an image in which a target is blurred, dark or small: at another scale, brighter, sharper."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sized
from typing import NamedTuple, TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray

from basecal.geometry import Array

_DARK_BRIGHT_PERCENT = (1, 99)  # levels that become black and white: past reflections, lamps and dead pixels
_LEVEL_STRIDE = 4  # rows and columns between those whose levels tell the darkest and the brightest
_BLUR_PX, _SHARPENING_GAIN = 3.0, 1.5  # unsharp masking: markers blurred by 3 px are read that were not
_MOST_PIXELS = 2**22  # of an enlarged image: in 4 megapixels nothing is too small, and more take seconds
_LEAST_SIDE_PX = 16  # of any image: OpenCV's detectors fail in less

Grey = NDArray[np.uint8]
S = TypeVar("S", bound=Sized)


class Way(NamedTuple):
    """A change of an image before it is searched.

    Attributes:
        scale: Of its sides.
        stretched: Whether its levels are stretched over all there are.
        sharpened: Whether it is sharpened.
    """

    scale: float = 1.0
    stretched: bool = False
    sharpened: bool = False

    def suits(self, image: Grey) -> bool:
        """Whether an image is of a size that can be searched so."""
        sides = [round(self.scale * side) for side in image.shape]
        return min(sides) >= _LEAST_SIDE_PX and (self.scale <= 1 or sides[0] * sides[1] <= _MOST_PIXELS)

    def apply(self, image: Grey) -> Grey:
        """The image as it is searched."""
        if self.stretched:
            low, high = np.percentile(image[::_LEVEL_STRIDE, ::_LEVEL_STRIDE], _DARK_BRIGHT_PERCENT)
            levels = (np.arange(256) - low) * (255.0 / max(high - low, 1.0))
            image = np.asarray(cv2.LUT(image, np.clip(np.rint(levels), 0, 255).astype(np.uint8)), np.uint8)
        if self.scale != 1:
            kind = cv2.INTER_AREA if self.scale < 1 else cv2.INTER_CUBIC
            image = np.asarray(cv2.resize(image, None, fx=self.scale, fy=self.scale, interpolation=kind), np.uint8)
        if self.sharpened:
            blurred = cv2.GaussianBlur(image, (0, 0), _BLUR_PX)
            image = np.asarray(cv2.addWeighted(image, 1 + _SHARPENING_GAIN, blurred, -_SHARPENING_GAIN, 0), np.uint8)
        return image

    def places(self, pixels: object) -> Array:
        """Where pixels of the image that was searched are in the image itself, (n, 2) [px]."""
        found = np.asarray(pixels, dtype=np.float64).reshape(-1, 2)
        return (found + 0.5) / self.scale - 0.5


MARKER_WAYS = (Way(), Way(stretched=True), Way(stretched=True, sharpened=True), Way(2.0, stretched=True))
"""Of markers: as most images are, dark, blurred, and small ones."""


def best_result(image: Grey, ways: Iterable[Way], search: Callable[[Grey, Way], S], enough_count: float) -> S | None:
    """The most that is found by some of the ways, tried in turn until one finds enough; None if it is nothing.

    Args:
        image: (h, w).
        ways: The quickest first.
        search: What is found in an image as a way shows it.
        enough_count: How many are.
    """
    most: S | None = None
    for way in ways:
        if not way.suits(image):
            continue
        seen = search(way.apply(image), way)
        if len(seen) > (0 if most is None else len(most)):
            most = seen
        if len(seen) >= enough_count:
            break
    return most
