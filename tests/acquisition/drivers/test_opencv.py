"""Whatever OpenCV opens is a camera."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from basecal.acquisition.driver import Place
from basecal.acquisition.drivers.opencv import open_camera
from basecal.cell import Cell, Robot
from basecal.errors import DatasetError, DriverError

CELL = Cell("eye", {"eye": Robot("eye")})


def test_a_film_gives_its_pictures(tmp_path):
    """Pictures come with rising stamps, and the end of the film is an error that says so."""
    path = str(tmp_path / "film.avi")
    writer = cv2.VideoWriter(path, cv2.VideoWriter_fourcc(*"MJPG"), 10, (64, 48))
    for level in (50, 150):
        writer.write(np.full((48, 64, 3), level, dtype=np.uint8))
    writer.release()
    camera = open_camera(Place("wrist", CELL, tmp_path, {"source": path}))
    first, second = camera.picture(), camera.picture()
    assert first.grey.mean() < 100 < second.grey.mean()
    assert first.stamp_s < second.stamp_s
    with pytest.raises(DriverError, match="wrist: the stream has ended"):
        camera.picture()
    camera.close()


def test_what_cannot_be_opened(tmp_path):
    """A path without a film, and a source that is none, are told in a line."""
    with pytest.raises(DriverError, match="OpenCV cannot open"):
        open_camera(Place("wrist", CELL, tmp_path, {"source": str(tmp_path / "none.avi")}))
    with pytest.raises(DatasetError, match=r"cameras\.wrist\.driver\.source"):
        open_camera(Place("wrist", CELL, tmp_path, {"source": -1}))
