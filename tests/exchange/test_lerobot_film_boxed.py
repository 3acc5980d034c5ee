"""Films in their box: images at times, and films that are too large or none."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from basecal.errors import InputError
from basecal.exchange import lerobot_film_boxed
from basecal.exchange.lerobot_film_boxed import read_frames

FILM = str(Path(__file__).parents[1] / "data" / "film_av1.mp4")  # number k of 60 has the level 4 k, at 30 Hz


def test_images_come_by_rising_times() -> None:
    """Each with the place of its time among those asked for; those beyond the end do not come."""
    found = list(read_frames([FILM, "1.0", "0.1", "9.0"]))
    assert [place for (place,), _ in found] == [1, 0]
    levels = [cv2.imdecode(np.frombuffer(content, np.uint8), cv2.IMREAD_UNCHANGED).mean() for _, content in found]
    np.testing.assert_allclose(levels, [12, 120], atol=3)


def test_large_images_are_not_decoded(monkeypatch: pytest.MonkeyPatch) -> None:
    """The film says how large they are."""
    monkeypatch.setattr(lerobot_film_boxed, "_MOST_PIXELS", 64 * 48 - 1)
    with pytest.raises(InputError, match="has images of 64 x 48 px, which is more than is read"):
        list(read_frames([FILM, "0.0"]))


def test_time_before_all_is_the_first_image() -> None:
    """A clock that is a hair early asks for no frame before the first."""
    ((_, content),) = read_frames([FILM, "-0.001"])
    assert cv2.imdecode(np.frombuffer(content, np.uint8), cv2.IMREAD_UNCHANGED).mean() < 3
