"""Tests of cameras and films opened by OpenCV."""

from __future__ import annotations

import time

import cv2
import numpy as np
import pytest

from basecal.acquisition.driver import Place
from basecal.acquisition.drivers.opencv import OpencvCamera, open_camera
from basecal.cell import Cell, Robot
from basecal.errors import DatasetError, DriverError
from basecal.vision.stream import Stream

CELL = Cell("eye", {"eye": Robot("eye")})


def test_film_yields_its_images(tmp_path):
    """Stamps increase, and the end of the film is an error that says so."""
    path = str(tmp_path / "film.avi")
    writer = cv2.VideoWriter(path, cv2.VideoWriter_fourcc(*"MJPG"), 10, (64, 48))
    for level in (50, 150):
        writer.write(np.full((48, 64, 3), level, dtype=np.uint8))
    writer.release()
    camera = open_camera(Place("wrist", CELL, tmp_path, {"source": path}))
    first, second = camera.image(), camera.image()
    assert first.grey.mean() < 100 < second.grey.mean()
    assert first.stamp_s < second.stamp_s
    assert (camera.is_live, camera.is_on_demand) == (False, True)  # read on by itself, it would have ended by now
    with pytest.raises(DriverError, match="wrist: the stream has ended"):
        camera.image()
    camera.close()


class Device:
    """Capture of OpenCV whose images have the time 5.5 s."""

    def __init__(self, backend):
        self.backend = backend

    def getBackendName(self):
        return self.backend

    def read(self):
        return True, np.zeros((4, 6, 3), dtype=np.uint8)

    def get(self, of):
        return 5500.0 if of == cv2.CAP_PROP_POS_MSEC else 0.0


def test_kernel_time_is_the_stamp():
    """V4L2 cameras have exposure times; the position in another stream is none."""
    stamped, other = (OpencvCamera("wrist", Stream(Device(backend)), is_file=False) for backend in ("V4L2", "FFMPEG"))
    assert (stamped.is_stamped, stamped.image().stamp_s) == (True, 5.5)
    assert not other.is_stamped
    assert other.image().stamp_s == pytest.approx(time.monotonic(), abs=1.0)
    assert (stamped.is_live, stamped.is_on_demand) == (True, False)


def test_source_that_cannot_be_opened_is_reported(tmp_path):
    """A path without a film, and an unknown source, cause one line."""
    with pytest.raises(DriverError, match="OpenCV cannot open"):
        open_camera(Place("wrist", CELL, tmp_path, {"source": str(tmp_path / "none.avi")}))
    with pytest.raises(DatasetError, match=r"cameras\.wrist\.driver\.source"):
        open_camera(Place("wrist", CELL, tmp_path, {"source": -1}))
