"""Pictures that appear in a folder."""

from __future__ import annotations

import threading
import time

import numpy as np
import pytest

from basecal.acquisition.driver import Place
from basecal.acquisition.drivers.folder import open_camera
from basecal.cell import Cell, CellCamera, Robot
from basecal.errors import DatasetError, DriverError
from basecal.vision.image_file import write_png

CELL = Cell("eye", {"eye": Robot("eye")}, cameras={"wrist": CellCamera("wrist", "eye", size_px=(32, 24))})


def picture(level, size=(24, 32)):
    return np.full(size, level, dtype=np.uint8)


def camera(folder, **options):
    return open_camera(Place("wrist", CELL, folder, {"path": "pictures", "wait_s": 0.2, **options}))


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "pictures").mkdir()
    write_png(tmp_path / "pictures" / "old.png", picture(10))
    return tmp_path


def test_new_pictures_are_given_once(folder):
    """Those that were there before do not count; new ones come in the order in which they were written."""
    source = camera(folder)
    for level in (100, 50):
        write_png(folder / "pictures" / f"{level}.png", picture(level))
        time.sleep(0.02)
    assert [int(source.picture().grey[0, 0]) for _ in range(2)] == [100, 50]
    with pytest.raises(DriverError, match=r"no new picture in .* within 0\.2 s"):
        source.picture()


def test_those_of_before_count_where_asked(folder):
    """With `existing` the folder is gone through from its start."""
    assert camera(folder, existing=True).picture().grey[0, 0] == 10


def test_a_file_that_is_being_written_is_waited_for(folder):
    """A half of a file is no picture; when its end has come it is one."""
    source, path = camera(folder, wait_s=5.0), folder / "pictures" / "late.png"
    write_png(folder / "whole.png", picture(77))
    whole = (folder / "whole.png").read_bytes()
    path.write_bytes(whole[:40])
    threading.Timer(0.15, path.write_bytes, [whole]).start()
    assert source.picture().grey[0, 0] == 77


def test_a_picture_that_does_not_suit_is_named(folder):
    """One of another size than the camera's is not given, and the error that nothing came says why."""
    source = camera(folder)
    write_png(folder / "pictures" / "large.png", picture(5, (48, 64)))
    with pytest.raises(DriverError, match=r"large\.png has 64 x 48 pixels"):
        source.picture()


def test_a_folder_that_is_not_there(tmp_path):
    """It is named with the field that names it."""
    with pytest.raises(DatasetError, match=r"cameras\.wrist\.driver\.path: there is no folder"):
        camera(tmp_path)
