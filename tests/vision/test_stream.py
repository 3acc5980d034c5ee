"""Pictures of a video, grey, one after another."""

from __future__ import annotations

import cv2
import numpy as np

from basecal.vision.stream import open_stream

LEVELS = (40, 120, 200)


def video(path):
    """A film of three pictures, each of one grey level."""
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"MJPG"), 10, (64, 48))
    for level in LEVELS:
        writer.write(np.full((48, 64, 3), level, dtype=np.uint8))
    writer.release()
    return str(path)


def test_a_film_is_read_to_its_end(tmp_path):
    """Its pictures come in order as (h, w), to within what compression does; then there is none."""
    stream = open_stream(video(tmp_path / "film.avi"))
    levels = [stream.read() for _ in LEVELS]
    assert {picture.shape for picture in levels} == {(48, 64)}
    assert all(abs(picture.mean() - level) < 4 for picture, level in zip(levels, LEVELS, strict=True))
    assert stream.read() is None
    stream.close()


def test_nothing_is_opened_where_there_is_nothing(tmp_path):
    """A path without a film gives None, not an error."""
    assert open_stream(str(tmp_path / "none.avi")) is None
