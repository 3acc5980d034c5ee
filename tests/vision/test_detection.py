"""Tests of detections and of the images that detectors accept."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from basecal.errors import InputError
from basecal.vision.detection import check_image, eight_bit, full_scale, make_detection


def test_points_are_sorted_by_id() -> None:
    """Points are sorted by their ids, each with its pixel and sigma. There is no detection without points."""
    detection = make_detection(np.array([7, 2, 5]), np.array([[7.0, 0], [2, 0], [5, 0]]), np.array([0.7, 0.2, 0.5]))
    assert detection is not None
    np.testing.assert_array_equal(detection.ids, [2, 5, 7])
    np.testing.assert_array_equal(detection.pixels[:, 0], [2, 5, 7])
    np.testing.assert_array_equal(detection.sigma_px, [0.2, 0.5, 0.7])
    assert make_detection(np.zeros(0, np.int64), np.zeros((0, 2)), np.zeros(0)) is None


@pytest.mark.parametrize(
    ("top", "scale"), [(200, 255), (255, 255), (1000, 1023), (4095, 4095), (4096, 8191), (65535, 65535)]
)
def test_full_scale_is_that_of_used_bits(top: int, scale: int) -> None:
    """The full scale of a 16-bit image is that of its used bits, at least 8."""
    image = np.array([[0, 1, top]], np.uint16)
    assert full_scale(image) == scale
    assert eight_bit(image).max() == pytest.approx(255 * top / scale, abs=0.5)


@pytest.mark.parametrize(("bits", "top"), [(12, 65520), (10, 65472), (8, 65280)])
def test_full_scale_of_upper_bits(bits: int, top: int) -> None:
    """Some cameras store 12 bits in the upper bits of 16.

    Their saturated spots were formerly taken for unsaturated ones.
    """
    image = (np.arange(2**bits, dtype=np.uint16) << (16 - bits))[None]
    assert full_scale(image) == image.max() == top


def test_image_of_two_levels_is_not_saturated() -> None:
    """A 16-bit image with only the levels 0 and 32768 is not saturated."""
    assert full_scale(np.array([[0, 2**15]], np.uint16)) > 2**15


def test_eight_bit_image_is_unchanged() -> None:
    """An image of 8 bits is not stretched."""
    image = np.array([[3, 90]], np.uint8)
    np.testing.assert_array_equal(eight_bit(image), image)
    assert full_scale(image) == 255


@pytest.mark.parametrize(
    "image", [np.zeros((4, 4, 3), np.uint8), np.zeros((4, 4), np.float64), np.zeros((0, 4), np.uint8)]
)
def test_unsupported_image_type_is_refused(image: Any) -> None:
    """Colour images, other types and empty arrays are input errors."""
    with pytest.raises(InputError, match=r"expected \(h, w\) of uint8 or uint16"):
        check_image(image)
