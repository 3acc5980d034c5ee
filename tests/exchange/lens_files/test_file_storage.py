"""Tests of files written by OpenCV's FileStorage, read as plain data."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from basecal.errors import DatasetError
from basecal.exchange.lens_files.file_storage import _DEEPEST, read_file_storage

MATRIX = np.array([[766.5, 0, 640.9], [0, 765.4, 1e-7], [0, 0, 1]])


@pytest.mark.parametrize("suffix", ["yml", "xml", "json"])
def test_opencv_storage_is_read_exactly(tmp_path: Path, suffix: str) -> None:
    """A matrix, integers, floats, text, a list and a mapping are read exactly as given to OpenCV."""
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
        ("<opencv_storage><a>1</a><b>2</b><a>3</a></opencv_storage>", "storage: a: is given twice: keep one"),
        ("%YAML:1.0\n---\na: [1, 2\n", "not YAML"),
        ('{"a": [1, 2', "not YAML"),
    ],
)
def test_invalid_storage_is_reported(tmp_path: Path, text: str, message: str) -> None:
    """Broken files, entities, and nesting deeper than OpenCV writes are errors."""
    path = tmp_path / "storage"
    path.write_text(text)
    with pytest.raises(DatasetError, match=message):
        read_file_storage(path)


def test_json_comments_are_skipped(tmp_path: Path) -> None:
    """Comments on one or several lines are skipped; faults after them have their own line number."""
    path = tmp_path / "storage"
    path.write_text('{\n// one\n  // two "a": 1\n/* three\n "a": 2 */\n\t"a": 3, "url": "http://host" }')
    root = read_file_storage(path)
    assert root.find("a").integer() == 3
    assert root.find("url").text() == "http://host"
    path.write_text('{ /* one\n\n*/\n// two\n"a": "word" }')
    with pytest.raises(DatasetError, match="storage:5"):
        read_file_storage(path).find("a").integer()


@pytest.mark.parametrize(("text", "value"), [
    ("12", 12), ("-7", -7), ("+7", 7), ("123456789012345678", 123456789012345678),
    ("1234567890123456789", 1234567890123456768),
    ("1.", 1.0), (".5e-3", 5e-4), ('"word"', "word"), ("3 x", [3, "x"]), ("", []), ("<_>1</_>", [1]),
    ("<_>1 2</_><_>3</_>", [[1, 2], 3]), ("<b>1</b><c>2</c>", {"b": 1, "c": 2}),
])  # fmt: skip
def test_xml_values_are_converted(tmp_path: Path, text: str, value: object) -> None:
    """Integers of up to 18 digits are exact. One word is a scalar; several words, and elements `_`, are a list."""
    path = tmp_path / "storage"
    path.write_text(f"<opencv_storage><a>{text}</a></opencv_storage>")
    found = read_file_storage(path).find("a").data
    assert (found, isinstance(found, float)) == (value, text in {"1.", ".5e-3", "1234567890123456789"})


def test_xml_nesting_limit(tmp_path: Path) -> None:
    """32 levels below the root are read, one more is refused."""
    path = tmp_path / "storage"
    path.write_text("<a>" * 33 + "</a>" * 33)
    read_file_storage(path)
    path.write_text("<a>" * 34 + "</a>" * 34)
    with pytest.raises(DatasetError, match="nested deeper than 32 levels"):
        read_file_storage(path)


@pytest.mark.parametrize("tag", ["_", "a"])
def test_storage_nesting_limit_by_element(tmp_path: Path, tag: str) -> None:
    """Lists and mappings up to the limit are read, and one level more is refused."""
    for depth in (_DEEPEST - 1, _DEEPEST + 1):
        text = f"<{tag}>" * depth + "1 2" + f"</{tag}>" * depth
        (tmp_path / "a.xml").write_text(f"<opencv_storage>{text}</opencv_storage>")
        if depth > _DEEPEST:
            with pytest.raises(DatasetError, match=f"nested deeper than {_DEEPEST} levels"):
                read_file_storage(tmp_path / "a.xml")
        else:
            data = read_file_storage(tmp_path / "a.xml").data
            for _ in range(depth):
                (data,) = data if isinstance(data, list) else data.values()
            assert data == [1, 2]
