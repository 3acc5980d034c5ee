"""Small images of images."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from basecal.vision.thumbnail import thumbnail


def encoded(image):
    """As the bytes of a PNG."""
    return cv2.imencode(".png", image)[1].tobytes()


@pytest.mark.parametrize(("dtype", "white"), [(np.uint8, 255), (np.uint16, 4000)])
def test_it_is_small_and_shows_the_same(dtype, white):
    """A third as wide, the bright half bright and the dark half dark, also of 16 bits that are not filled."""
    image = np.zeros((600, 900), dtype)
    image[:, 450:] = white
    small = cv2.imdecode(np.frombuffer(thumbnail(encoded(image), (900, 600), 300), np.uint8), cv2.IMREAD_UNCHANGED)
    assert small.shape == (200, 300)
    assert small[:, :140].max() < 20
    assert small[:, 160:].min() > 235


def test_a_small_image_is_not_made_larger():
    """It keeps its size."""
    small = thumbnail(encoded(np.zeros((40, 60), np.uint8)), None, 300)
    assert cv2.imdecode(np.frombuffer(small, np.uint8), cv2.IMREAD_UNCHANGED).shape == (40, 60)


@pytest.mark.parametrize(
    ("data", "size_px"), [(b"", None), (b"no image", None), (encoded(np.zeros((4, 4), np.uint8)), (5, 5))]
)
def test_what_is_no_such_image_has_none(data, size_px):
    """Nothing, something else, or another size."""
    assert thumbnail(data, size_px, 300) is None
