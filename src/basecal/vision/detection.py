"""The result of a detector, and its input images."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from basecal.errors import InputError
from basecal.geometry import Array, IntArray, read_only, read_only_ids

_WHITE_LEVEL = 255.0  # the highest level of 8 bits
_LARGEST_STEP = 2**8  # between levels of 16 bits: a camera has at least 8

Image = NDArray[np.integer[Any]]
"""Grey levels, (h, w), uint8 or uint16."""


@dataclass(frozen=True, eq=False)
class Detection:
    """A target found in an image.

    Attributes:
        ids: Ids of the points, (n,), ascending; None for candidates, brightest first, of which at most one is the LED.
        pixels: (n, 2) [px], the centre of the top-left pixel is (0, 0).
        sigma_px: Standard deviation per coordinate, (n,) [px].
    """

    ids: IntArray | None
    pixels: Array
    sigma_px: Array


def make_detection(ids: IntArray, pixels: Array, sigma_px: Array) -> Detection | None:
    """A detection sorted by ids; None if there is no point."""
    if not len(ids):
        return None
    order = np.argsort(ids)
    return Detection(read_only_ids(ids[order]), read_only(pixels[order]), read_only(sigma_px[order]))


def full_scale(image: Image) -> float:
    """Highest possible level of an image; for 16 bits of the bits in use.

    Cameras of 10 to 14 bits use the lower bits or the upper ones.
    """
    if image.dtype == np.uint8:
        return _WHITE_LEVEL
    used_bits = int(np.bitwise_or.reduce(image, axis=None))
    step = min(max(used_bits & -used_bits, 1), _LARGEST_STEP)
    return float(max(2 ** used_bits.bit_length() - step, _WHITE_LEVEL))


def check_image(image: Image) -> None:
    """Check that an image can be searched.

    Raises:
        InputError: if it is not a grey image of 8 or 16 bits.
    """
    if image.ndim != 2 or image.dtype not in (np.uint8, np.uint16) or not image.size:
        raise InputError(f"an image has shape {image.shape} and type {image.dtype}, expected (h, w) of uint8 or uint16")


def eight_bit(image: Image) -> NDArray[np.uint8]:
    """Convert an image to 8 bits for the search of targets; points are then measured in the original image.

    Raises:
        InputError: if it is not a grey image of 8 or 16 bits.
    """
    check_image(image)
    if image.dtype == np.uint8:
        return np.asarray(image, dtype=np.uint8)
    return np.asarray(cv2.convertScaleAbs(image, alpha=_WHITE_LEVEL / full_scale(image)), dtype=np.uint8)
