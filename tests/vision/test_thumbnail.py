"""Tests of thumbnails of images."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from basecal.vision.thumbnail import thumbnail


def encoded(image):
    """PNG bytes of an image."""
    return cv2.imencode(".png", image)[1].tobytes()


@pytest.mark.parametrize(("dtype", "white"), [(np.uint8, 255), (np.uint16, 4000)])
def test_thumbnail_is_smaller_with_same_contents(dtype, white):
    """A thumbnail of a third of the width has the bright and the dark half.

    This holds for 16 bits that are not fully used, too.
    """
    image = np.zeros((600, 900), dtype)
    image[:, 450:] = white
    small = cv2.imdecode(np.frombuffer(thumbnail(encoded(image), (900, 600), 300), np.uint8), cv2.IMREAD_UNCHANGED)
    assert small.shape == (200, 300)
    assert small[:, :140].max() < 20
    assert small[:, 160:].min() > 235


def test_small_image_is_not_enlarged():
    """A small image keeps its size."""
    small = thumbnail(encoded(np.zeros((40, 60), np.uint8)), None, 300)
    assert cv2.imdecode(np.frombuffer(small, np.uint8), cv2.IMREAD_UNCHANGED).shape == (40, 60)


@pytest.mark.parametrize(
    ("data", "size_px"), [(b"", None), (b"no image", None), (encoded(np.zeros((4, 4), np.uint8)), (5, 5))]
)
def test_unusable_image_has_no_thumbnail(data, size_px):
    """An empty file, other data, or an image of another size has no thumbnail."""
    assert thumbnail(data, size_px, 300) is None


def thumbnail_levels(image, size_px=None, width=300):
    """Levels of a thumbnail."""
    return cv2.imdecode(np.frombuffer(thumbnail(encoded(image), size_px, width), np.uint8), cv2.IMREAD_UNCHANGED)


def test_sixteen_bit_levels_are_relative_to_brightest():
    """A few hot pixels do not darken the others.

    Half of the brightest level is half as bright, and black stays black.
    """
    image = np.full((100, 200), 2000, np.uint16)
    image[:, :100] = 1000
    image[0, :50] = 65535
    small = thumbnail_levels(image)
    assert abs(int(small[50, 50]) - 127) < 4
    assert small[50, 150] > 250
    assert thumbnail_levels(np.zeros((40, 60), np.uint16)).max() < 4
    assert thumbnail_levels(np.full((40, 60), 2, np.uint16)).min() > 250


@pytest.mark.parametrize(("shape", "small"), [((1, 2000), (1, 300)), ((2000, 1), (2000, 1)), ((2, 900), (1, 300))])
def test_narrow_image_keeps_one_pixel(shape, small):
    """No side of a thumbnail becomes zero."""
    assert thumbnail_levels(np.zeros(shape, np.uint8)).shape == small
