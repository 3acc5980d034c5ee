"""Tests of reading the grey images of a video in sequence."""

from __future__ import annotations

import os
import socket
import time

import cv2
import numpy as np
import pytest

from basecal.vision import stream
from basecal.vision.stream import open_stream

LEVELS = (40, 120, 200)


def video(path):
    """Video of three images, each of one grey level."""
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"MJPG"), 10, (64, 48))
    for level in LEVELS:
        writer.write(np.full((48, 64, 3), level, dtype=np.uint8))
    writer.release()
    return path


def test_video_is_read_to_its_end(tmp_path):
    """Images of a video come in order as (h, w), within the accuracy of the compression; then the stream gives None."""
    film = open_stream(video(tmp_path / "film.avi"))
    levels = [film.read() for _ in LEVELS]
    assert {image.shape for image in levels} == {(48, 64)}
    assert all(abs(image.mean() - level) < 4 for image, level in zip(levels, LEVELS, strict=True))
    assert film.read() is None
    film.close()


def test_missing_video_gives_none(tmp_path):
    """A path without a video gives None, not an error."""
    assert open_stream(tmp_path / "none.avi") is None


def test_pipe_and_playlist_are_refused(tmp_path):
    """A pipe with the name of a video is refused without waiting. A playlist with an address opens no connection."""
    os.mkfifo(tmp_path / "film.avi")
    assert open_stream(tmp_path / "film.avi") is None
    with socket.create_server(("127.0.0.1", 0)) as server:
        server.settimeout(0.5)
        address = f"http://127.0.0.1:{server.getsockname()[1]}/a.ts"
        (tmp_path / "a.m3u8").write_text(f"#EXTM3U\n#EXTINF:10,\n{address}\n#EXT-X-ENDLIST\n")
        assert open_stream(tmp_path / "a.m3u8") is None
        with pytest.raises(TimeoutError):
            server.accept()


def test_unresponsive_address_times_out(monkeypatch):
    """An UDP address without data is given up after the timeouts, which are a few seconds."""
    assert stream._TIMEOUT_MS <= 5000
    short = [500 if each == stream._TIMEOUT_MS else each for each in stream._TIMEOUTS]
    monkeypatch.setattr(stream, "_TIMEOUTS", short)
    began_s = time.monotonic()
    assert open_stream("udp://127.0.0.1:5999") is None
    assert time.monotonic() - began_s < 4
