"""Tests of the camera driver for images that appear in a folder."""

from __future__ import annotations

import os
import threading
import time
from pathlib import Path

import numpy as np
import pytest

from basecal.acquisition.driver import Place
from basecal.acquisition.drivers.folder import open_camera
from basecal.acquisition.stillness import wait_for_image
from basecal.cell import Cell, CellCamera, Robot
from basecal.errors import DatasetError, DriverError
from basecal.vision.image_file import write_png

CELL = Cell("eye", {"eye": Robot("eye")}, cameras={"wrist": CellCamera("wrist", "eye", size_px=(32, 24))})


def image(level, size=(24, 32)):
    return np.full(size, level, dtype=np.uint8)


def camera(folder, **options):
    return open_camera(Place("wrist", CELL, folder, {"path": "images", "wait_s": 0.2, **options}))


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "images").mkdir()
    write_png(tmp_path / "images" / "old.png", image(10))
    return tmp_path


def save(folder, level, written_s=None):
    path = folder / "images" / f"{level}.png"
    write_png(path, image(level))
    if written_s is not None:
        os.utime(path, (written_s, written_s))


def test_newest_new_image_is_returned_once(folder):
    """Existing images do not count; of several new ones the latest is returned, with its name."""
    source = camera(folder)
    save(folder, 100, 2000.0)
    save(folder, 50, 3000.0)
    given = source.image()
    assert (given.grey[0, 0], given.stamp_s, given.source) == (50, pytest.approx(3000.0), "50.png")
    with pytest.raises(DriverError, match=r"no new image in .* within 0\.2 s"):
        source.image()


def test_single_image_suffices(folder):
    """A person who saves it ensures that all is at rest: no further image is required."""
    source = camera(folder)
    save(folder, 50, 3000.0)
    assert wait_for_image(source, [], 5.0).source == "50.png"


def test_late_image_is_returned_with_its_stamp(folder):
    """An image written before the last is returned as well: its stamp shows that it is older."""
    source = camera(folder)
    save(folder, 50, 3000.0)
    assert source.image().stamp_s == pytest.approx(3000.0)
    save(folder, 100, 2000.0)
    assert source.image().stamp_s == pytest.approx(2000.0)


def test_vanished_file_is_no_error(folder, monkeypatch):
    """A file that is renamed before it is read is ignored."""
    source, iterdir = camera(folder), Path.iterdir
    monkeypatch.setattr(Path, "iterdir", lambda path: [path / "gone.part", *iterdir(path)])
    monkeypatch.setattr(Path, "is_file", lambda path: True)
    save(folder, 70)
    assert source.image().grey[0, 0] == 70


def test_existing_images_count_on_request(folder):
    """With `existing` the folder is read from its start, the oldest image first."""
    save(folder, 20, time.time() + 1)
    source = camera(folder, existing=True)
    assert [source.image().grey[0, 0] for _ in range(2)] == [10, 20]


def test_incomplete_file_is_waited_for(folder):
    """A partial file is no image until it is complete."""
    source, path = camera(folder, wait_s=5.0), folder / "images" / "late.png"
    write_png(folder / "whole.png", image(77))
    whole = (folder / "whole.png").read_bytes()
    path.write_bytes(whole[:40])
    threading.Timer(0.15, path.write_bytes, [whole]).start()
    assert source.image().grey[0, 0] == 77


def test_file_that_is_no_image_is_reported(folder):
    """It is not returned, and the timeout error gives the reason."""
    source = camera(folder)
    (folder / "images" / "notes.png").write_text("hello", encoding="utf-8")
    with pytest.raises(DriverError, match=r"notes\.png is not an image"):
        source.image()


@pytest.mark.journey
def test_first_file_that_is_no_image_is_reported_soon(folder, monkeypatch):
    """A program with another format is reported within seconds; not after a first image, and not for hidden files."""
    monkeypatch.setattr("basecal.acquisition.drivers.folder._WRITING_S", 0.05)
    source = camera(folder, wait_s=0.5)
    (folder / "images" / ".hidden").write_text("x", encoding="utf-8")
    save(folder, 60)
    assert source.image().grey[0, 0] == 60
    (folder / "images" / "raw.cr2").write_text("x", encoding="utf-8")
    with pytest.raises(DriverError, match=r"no new image in .* within 0\.5 s; raw\.cr2 is not an image"):
        source.image()
    source = camera(folder, wait_s=10.0)
    for name in ("next.cr2", "next.txt"):
        (folder / "images" / name).write_text("x", encoding="utf-8")
    began = time.monotonic()
    with pytest.raises(DriverError, match=r"next\.\w+ is not an image .*\. Save complete images, as PNG, JPEG"):
        source.image()
    assert time.monotonic() - began < 5.0


def test_unreadable_files_are_not_remembered_after_the_first_image(folder):
    """A file that is rewritten for hours needs no memory."""
    source = camera(folder, wait_s=0.01)
    save(folder, 60)
    source.image()
    remembered = len(source._unreadable_s)
    for k in range(5):
        path = folder / "images" / "half.png"
        path.write_text("x", encoding="utf-8")
        os.utime(path, (time.time() + k, time.time() + k))
        with pytest.raises(DriverError, match=r"half\.png is not an image"):
            source.image()
    assert len(source._unreadable_s) == remembered


def test_missing_folder_is_reported(tmp_path):
    """The error has the field of the folder."""
    with pytest.raises(DatasetError, match=r"cameras\.wrist\.driver\.path: there is no folder"):
        camera(tmp_path)
