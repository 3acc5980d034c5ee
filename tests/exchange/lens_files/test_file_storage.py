"""Files that OpenCV's FileStorage itself wrote, as plain data."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from basecal.errors import DatasetError
from basecal.exchange.lens_files.file_storage import read_file_storage

MATRIX = np.array([[766.5, 0, 640.9], [0, 765.4, 1e-7], [0, 0, 1]])


@pytest.mark.parametrize("suffix", ["yml", "xml", "json"])
def test_what_opencv_writes_is_read(tmp_path: Path, suffix: str) -> None:
    """A matrix, whole and other numbers, text, a list and a mapping, exactly as OpenCV was given them."""
    path = tmp_path / f"calibration.{suffix}"
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    storage.write("image_width", 1280)
    storage.write("calibration_time", "Sun 22 Nov 2026")
    storage.write("avg_reprojection_error", 0.123456789012345678)
    storage.write("camera_matrix", MATRIX)
    storage.startWriteStruct("rig", cv2.FILE_NODE_MAP)
    storage.write("number", -3)
    storage.endWriteStruct()
    storage.release()
    root = read_file_storage(path)
    assert root.find("image_width").integer() == 1280
    assert root.find("avg_reprojection_error").number() == 0.123456789012345678
    assert root.find("camera_matrix").find("rows").integer() == 3
    np.testing.assert_array_equal(root.find("camera_matrix").find("data").numbers(9), MATRIX.ravel())
    assert root.find("rig").find("number").number() == -3


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("<opencv_storage><a>1</b></opencv_storage>", "storage:1: not XML"),
        ('<!DOCTYPE a [<!ENTITY x "y">]><opencv_storage>&x;</opencv_storage>', "not XML"),
        ("<a>" * 5000, "not XML"),
        ("<a>" * 100 + "</a>" * 100, "nested deeper than 32 levels"),
        ("%YAML:1.0\n---\na: [1, 2\n", "not YAML"),
        ('{"a": [1, 2', "not YAML"),
    ],
)
def test_what_is_none_is_told(tmp_path: Path, text: str, message: str) -> None:
    """Broken, with entities, or nested beyond what OpenCV writes."""
    path = tmp_path / "storage"
    path.write_text(text)
    with pytest.raises(DatasetError, match=message):
        read_file_storage(path)
