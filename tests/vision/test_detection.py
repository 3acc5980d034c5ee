"""What detectors give, and the images they take."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from basecal.errors import InputError
from basecal.vision.detection import check_image, eight_bit, full_scale, make_detection


def test_ids_rise() -> None:
    """Points come in the order of their ids, each with its own pixel and sigma; without any there is no detection."""
    detection = make_detection(np.array([7, 2, 5]), np.array([[7.0, 0], [2, 0], [5, 0]]), np.array([0.7, 0.2, 0.5]))
    assert detection is not None
    np.testing.assert_array_equal(detection.ids, [2, 5, 7])
    np.testing.assert_array_equal(detection.pixels[:, 0], [2, 5, 7])
    np.testing.assert_array_equal(detection.sigma_px, [0.2, 0.5, 0.7])
    assert make_detection(np.zeros(0, np.int64), np.zeros((0, 2)), np.zeros(0)) is None


@pytest.mark.parametrize(
    ("top", "scale"), [(200, 255), (255, 255), (1000, 1023), (4095, 4095), (4096, 8191), (65535, 65535)]
)
def test_full_scale_of_sixteen_bits(top: int, scale: int) -> None:
    """Of 16 bits those count that are used, and never fewer than 8."""
    image = np.array([[0, 1, top]], np.uint16)
    assert full_scale(image) == scale
    assert eight_bit(image).max() == pytest.approx(255 * top / scale, abs=0.5)


@pytest.mark.parametrize(("bits", "top"), [(12, 65520), (10, 65472), (8, 65280)])
def test_the_upper_bits_may_be_used(bits: int, top: int) -> None:
    """A saturated spot of a camera that stores 12 bits so was taken for one that is not."""
    image = (np.arange(2**bits, dtype=np.uint16) << (16 - bits))[None]
    assert full_scale(image) == image.max() == top


def test_an_image_of_two_levels_is_not_saturated() -> None:
    """Unless they are the lowest and the highest of 8 bits."""
    assert full_scale(np.array([[0, 2**15]], np.uint16)) > 2**15


def test_eight_bits_stay() -> None:
    """An image of 8 bits is not stretched."""
    image = np.array([[3, 90]], np.uint8)
    np.testing.assert_array_equal(eight_bit(image), image)
    assert full_scale(image) == 255


@pytest.mark.parametrize(
    "image", [np.zeros((4, 4, 3), np.uint8), np.zeros((4, 4), np.float64), np.zeros((0, 4), np.uint8)]
)
def test_what_is_no_image(image: Any) -> None:
    """Colour, other types and nothing at all are named errors."""
    with pytest.raises(InputError, match=r"expected \(h, w\) of uint8 or uint16"):
        check_image(image)
