"""Tests of films in the sandbox: images at times, oversized films and invalid ones."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from basecal.errors import InputError
from basecal.exchange import lerobot_film_boxed
from basecal.exchange.lerobot_film_boxed import read_frames

FILM = str(Path(__file__).parents[1] / "data" / "film_av1.mp4")  # number k of 60 has the level 4 k, at 30 Hz


def test_images_are_returned_in_time_order() -> None:
    """Each image has the index of its requested time; times beyond the end have no image."""
    found = list(read_frames([FILM, "1.0", "0.1", "9.0"]))
    assert [place for (place,), _ in found] == [1, 0]
    levels = [cv2.imdecode(np.frombuffer(content, np.uint8), cv2.IMREAD_UNCHANGED).mean() for _, content in found]
    np.testing.assert_allclose(levels, [12, 120], atol=3)


def test_large_film_images_are_not_decoded(monkeypatch: pytest.MonkeyPatch) -> None:
    """The size is taken from the film's header."""
    monkeypatch.setattr(lerobot_film_boxed, "_MOST_PIXELS", 64 * 48 - 1)
    with pytest.raises(InputError, match="has images of 64 x 48 px, which is more than is read"):
        list(read_frames([FILM, "0.0"]))


def test_time_before_start_gives_first_image() -> None:
    """A clock that is slightly early requests no frame before the first."""
    ((_, content),) = read_frames([FILM, "-0.001"])
    assert cv2.imdecode(np.frombuffer(content, np.uint8), cv2.IMREAD_UNCHANGED).mean() < 3


class Film:
    """Decoder of a film of a size [px] and a number of frames, at 10 Hz."""

    def __init__(self, width: int, height: int, frames: int, is_open: bool = True) -> None:
        self._sizes = {cv2.CAP_PROP_FPS: 10.0, cv2.CAP_PROP_FRAME_WIDTH: width, cv2.CAP_PROP_FRAME_HEIGHT: height}
        self._frames, self._now, self._is_open = frames, -1, is_open

    def isOpened(self) -> bool:
        return self._is_open

    def get(self, key: int) -> float:
        return float(self._sizes[key])

    def grab(self) -> bool:
        self._now += 1
        return self._now < self._frames

    def retrieve(self) -> tuple[bool, np.ndarray]:
        return True, np.full((4, 4), self._now, np.uint8)


def films(monkeypatch: pytest.MonkeyPatch, film: Film) -> None:
    monkeypatch.setattr(cv2, "VideoCapture", lambda *_: film)


def test_image_size_limit_is_33_million_pixels(monkeypatch: pytest.MonkeyPatch) -> None:
    """An 8K image is read, and one with a column more than the limit is not."""
    films(monkeypatch, Film(8192, 4096, 1))
    assert len(list(read_frames(["film", "0.0"]))) == 1
    films(monkeypatch, Film(8193, 4096, 1))
    with pytest.raises(InputError, match="has images of 8193 x 4096 px, which is more than is read"):
        list(read_frames(["film", "0.0"]))


def test_times_after_last_frame_have_no_image(monkeypatch: pytest.MonkeyPatch) -> None:
    """Later times have no image; a film without any frame is damaged."""
    films(monkeypatch, Film(4, 4, 1))
    assert [place for (place,), _ in read_frames(["film", "0.1", "0.0"])] == [1]
    for film in (Film(4, 4, 0), Film(4, 4, 1, is_open=False)):
        films(monkeypatch, film)
        with pytest.raises(InputError, match="cannot be decoded"):
            list(read_frames(["film", "0.0"]))


def test_two_times_of_one_frame_share_its_image(monkeypatch: pytest.MonkeyPatch) -> None:
    """A time belongs to the nearest frame."""
    films(monkeypatch, Film(4, 4, 5))
    found = {place: cv2.imdecode(np.frombuffer(data, np.uint8), -1)[0, 0] for (place,), data in read_frames(
        ["film", "0.31", "0.28", "0.12"]
    )}  # fmt: skip
    assert found == {0: 3, 1: 3, 2: 1}
