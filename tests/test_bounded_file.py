"""Tests of bounded reading: paths that are no file and files that are too large are refused at once."""

from __future__ import annotations

import os
import socket
from collections.abc import Callable
from pathlib import Path

import pytest

from basecal.bounded_file import read_bounded
from basecal.cell.files import read_calibration, read_cell, read_recording, read_truth
from basecal.errors import DatasetError
from basecal.exchange.controller_poses import read_poses
from basecal.exchange.importers.colmap import read_colmap_images
from basecal.exchange.importers.mrcal import read_cameramodel
from basecal.exchange.importers.opencv import read_opencv_lens
from basecal.exchange.lens_files.camera_info import read_camera_info
from basecal.exchange.lens_files.colmap import read_colmap_lenses
from basecal.exchange.streams import read_pixels
from basecal.kinematics import read_chain
from cell_example import CELL, URDF


def test_file_is_read_up_to_the_limit(tmp_path: Path) -> None:
    """All bytes are read up to the limit, and not one more."""
    path = tmp_path / "a"
    path.write_bytes(b"12345")
    assert read_bounded(path, 5) == b"12345"
    with pytest.raises(DatasetError, match=r"a: has more than 3\.81e-06 MB"):
        read_bounded(path, 4)
    with pytest.raises(DatasetError, match="there is no such file; make one"):
        read_bounded(tmp_path / "b", 4, "make one")
    with pytest.raises(DatasetError, match=r"b: cannot be read: there is no such file$"):
        read_bounded(tmp_path / "b", 4)
    with pytest.raises(DatasetError, match=r"cannot be read: .*embedded null"):
        read_bounded("a\0b", 4)


def a_folder(path: Path) -> None:
    path.mkdir()


def a_socket(path: Path) -> None:
    here = os.getcwd()
    os.chdir(path.parent)  # since the name of a socket is short
    try:
        with socket.socket(socket.AF_UNIX) as bound:
            bound.bind(path.name)
    finally:
        os.chdir(here)


def an_endless_file(path: Path) -> None:
    path.symlink_to("/dev/zero")


def a_large_file(path: Path) -> None:
    """Create a sparse file of a terabyte."""
    with path.open("wb") as file:
        file.truncate(2**40)


READERS: dict[str, tuple[str, Callable[[Path], object]]] = {
    "cell": ("cell.yaml", lambda path: read_cell(path.parent)),
    "urdf of a cell": ("hand.urdf", lambda path: read_cell(path.parent)),
    "recording": ("recording/samples.jsonl", lambda path: read_recording(path.parent.parent)),
    "calibration": ("calibration.json", read_calibration),
    "truth": ("truth.yaml", lambda path: read_truth(path.parent)),
    "urdf": ("a.urdf", lambda path: read_chain(path, "base", "tool0")),
    "text": ("a.txt", lambda path: read_poses(path, "m")),
    "csv": ("a.csv", lambda path: read_poses(path, "m")),
    "npz": ("a.npz", lambda path: read_poses(path, "m")),
    "pixels": ("a.csv", read_pixels),
    "fields": ("a.yaml", read_camera_info),
    "file storage": ("a.yml", read_opencv_lens),
    "cameras of COLMAP": ("cameras.bin", read_colmap_lenses),
    "images of COLMAP": ("images.bin", read_colmap_images),
    "cameramodel": ("a.cameramodel", read_cameramodel),
}


@pytest.mark.parametrize("make", [a_folder, os.mkfifo, a_socket, an_endless_file, a_large_file])
@pytest.mark.parametrize("reader", READERS)
def test_readers_refuse_paths_that_are_no_file(tmp_path: Path, reader: str, make: Callable[[Path], None]) -> None:
    """Each reader refuses at once, without waiting and without large memory."""
    name, read = READERS[reader]
    (tmp_path / "cell.yaml").write_text(CELL)
    (tmp_path / "hand.urdf").write_text(URDF)
    path = tmp_path / name
    path.parent.mkdir(exist_ok=True)
    path.unlink(missing_ok=True)
    make(path)
    with pytest.raises(DatasetError, match=r"MB|cannot be read|is not a file|leads out|leaves the cell|no file"):
        read(path)
