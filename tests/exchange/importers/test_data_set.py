"""Tests of `basecal import industrial-calibration`."""

from __future__ import annotations

import os
from pathlib import Path

import cv2
import numpy as np
import pytest

from basecal.cell.files import read_cell, read_recording
from basecal.cell.targets.fiducials import DICTIONARIES
from basecal.cli import main
from basecal.errors import DatasetError
from basecal.exchange.fields import Field, parse_fields
from basecal.exchange.importers import data_set as module
from basecal.exchange.importers.data_set import _DICTIONARY_COUNT, read_data_set_record

TEXT = """\
data:
  - image: 0.png
    pose: 0.yaml
  - image: 1.png
    pose: 1.yaml
intrinsics: {fx: 135.2, fy: 135.6, cx: 78.9, cy: 62.7}
static_camera: true
target_finder:
  type: CharucoGridTargetFinder
  rows: 7
  cols: 5
  chessboard_dim: 0.036195
  aruco_marker_dim: 0.018256
  dictionary: 10
"""
DATA = Path(os.environ.get("BASECAL_DATA", Path(__file__).parents[4] / "shared" / "data"))
LISTING = "- image: images/0.png\n  pose: poses/0.yaml\n- pose: poses/1.yaml\n  image: images/1.png\n"
REST = """\
intrinsics:
  fx: 1352.0
  fy: 1356.0
  cx: 789.5
  cy: 627.5
camera_mount_to_camera_guess: {x: 0.1, y: 0.2, z: 0.3, qx: 0, qy: 0, qz: 0, qw: 1}
target_mount_to_target_guess: {x: 0.4, y: 0.5, z: 0.6, qx: 0, qy: 0, qz: 1, qw: 0}
homography_threshold: 2.0
static_camera: true
target_finder:
  type: CharucoGridTargetFinder
  rows: 7
  cols: 5
  chessboard_dim: 0.036195
  aruco_marker_dim: 0.018256
  dictionary: 10  # DICT_6X6_250
"""


def test_data_set_in_one_file_is_imported(tmp_path: Path) -> None:
    """A new cell has the poses, images, board and initial lens, and the camera's carrier."""
    for i in range(2):
        cv2.imwrite(str(tmp_path / f"{i}.png"), np.full((120, 160), 128, np.uint8))
        (tmp_path / f"{i}.yaml").write_text(f"x: 0.{i + 1}\ny: 0.2\nz: 0.3\nqz: 0\nqx: 1\nqw: 0\nqy: 0\n")
    (tmp_path / "cal_data.yaml").write_text(TEXT)
    assert main(["import", "industrial-calibration", str(tmp_path / "c"), str(tmp_path / "cal_data.yaml")]) == 0
    cell, samples = read_cell(tmp_path / "c"), read_recording(tmp_path / "c").samples
    ((_, camera),) = cell.cameras.items()
    ((_, target),) = cell.targets.items()
    assert camera.on == "world"
    assert target.target is not None
    assert (target.target.options["squares"], target.target.options["dictionary"]) == ([5, 7], "DICT_6X6_250")
    (state,) = samples[1].robots.values()
    assert state.base_from_flange is not None
    np.testing.assert_allclose(state.base_from_flange.translation, [0.2, 0.2, 0.3])
    assert all((tmp_path / "c" / sample.images[camera.name]).exists() for sample in samples)


def data_set(folder: Path, text: str) -> Path:
    (folder / "images").mkdir()
    (folder / "poses").mkdir()
    for i in range(2):
        (folder / "images" / f"{i}.png").write_bytes(b"")
        (folder / "poses" / f"{i}.yaml").write_text(f"x: 0.{i + 1}\ny: 0.2\nz: 0.3\nqz: 0\nqx: 1\nqw: 0\nqy: 0\n")
    path = folder / "cal_data.yaml"
    path.write_text(text)
    return path


def test_industrial_calibration_file_is_read(tmp_path: Path) -> None:
    """The list under `data` is beside the camera's carrier, lens, board and guesses."""
    indented = "".join(f"  {line}\n" for line in LISTING.splitlines())
    record = read_data_set_record(data_set(tmp_path, f"data:\n{indented}{REST}"))
    assert not record.camera_on_robot
    np.testing.assert_allclose(record.base_from_flange.translation, [[0.1, 0.2, 0.3], [0.2, 0.2, 0.3]])
    np.testing.assert_allclose(record.base_from_flange.rotation[0], np.diag([1, -1, -1]), atol=1e-12)
    assert [path.name for path in record.images] == ["0.png", "1.png"]
    assert record.camera_mount is not None
    assert record.target_mount is not None
    np.testing.assert_allclose(record.camera_mount.translation, [0.1, 0.2, 0.3])
    np.testing.assert_allclose(record.target_mount.translation, [0.4, 0.5, 0.6])
    assert record.lens["intrinsics"]["status"] == "free"
    assert record.lens["intrinsics"]["cx"] == 789.5
    assert record.target == {
        "kind": "charuco",
        "squares": [5, 7],
        "square_m": 0.036195,
        "marker_m": 0.018256,
        "dictionary": "DICT_6X6_250",
    }


def test_robot_cal_tools_files_are_read(tmp_path: Path) -> None:
    """The list has no header; lens and grid are in other files; the user states the camera's carrier."""
    path = data_set(tmp_path, LISTING)
    (tmp_path / "lens.yaml").write_text("intrinsics: {fx: 550, fy: 551, cx: 320, cy: 240}\n")
    (tmp_path / "target.yaml").write_text(
        "type: rct_ros_tools::ModifiedCircleGridTargetFinderPlugin\nrows: 10\ncols: 9\nspacing: 0.0254\n"
    )
    record = read_data_set_record(path, True, tmp_path / "lens.yaml", tmp_path / "target.yaml")
    assert record.camera_on_robot
    assert record.lens["intrinsics"]["fy"] == 551
    assert record.target == {"kind": "circles", "circles": [9, 10], "spacing_m": 0.0254}
    with pytest.raises(
        DatasetError, match=r"does not say whether the camera is on the robot .* give --camera-on robot"
    ):
        read_data_set_record(path)


def test_dictionaries_are_numbered_like_opencv() -> None:
    """The number of each dictionary is that of OpenCV's constant of its name."""
    assert [getattr(cv2.aruco, name) for name in DICTIONARIES[:_DICTIONARY_COUNT]] == list(range(_DICTIONARY_COUNT))


@pytest.mark.skipif(not DATA.is_dir(), reason="the project's shared data are not here")
def test_missing_image_of_real_data_set_is_named() -> None:
    """In robot_cal_tools' ChArUco set poses are read, and the first missing image is reported with its line."""
    with pytest.raises(DatasetError, match=r"cal_data.yaml:1: \[0\].image: there is no image .*images/0.png: put the"):
        read_data_set_record(DATA / "rct_charuco" / "cal_data.yaml", False)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("static_camera: true", "static_camera: false", "static_camera: contradicts --camera-on"),
        (
            "CharucoGridTargetFinder",
            "ArucoGridTargetFinder",
            "'ArucoGridTargetFinder' is not supported; there are: Charuc",
        ),
        ("dictionary: 10 ", "dictionary: 21 ", "dictionary: is 21, expected 0 to 20"),
        ("fx: 1352.0", "fx: 0.0", "intrinsics: the focal lengths are 0 and 1356 px"),
        ("pose: poses/1.yaml", "pose: poses/9.yaml", "poses/9.yaml: cannot be read"),
        ("- image: images/0.png", "- picture: images/0.png", r"data\[0\]: has no image; it has picture, pose"),
    ],
)
def test_unusable_data_sets_are_reported(tmp_path: Path, old: str, new: str, message: str) -> None:
    """A contradiction, an unsupported target, an invalid lens, and missing files are errors."""
    indented = "".join(f"  {line}\n" for line in LISTING.splitlines())
    text = f"data:\n{indented}{REST}"
    assert old in text
    with pytest.raises(DatasetError, match=message):
        read_data_set_record(data_set(tmp_path, text.replace(old, new)), camera_on_robot=False)


def finder(**fields: object) -> Field:
    """Return a description of a target."""
    return parse_fields("\n".join(f"{name}: {value}" for name, value in fields.items()), "t.yaml")


@pytest.mark.parametrize("number", [0, 20])
def test_charuco_limits_of_data_set(number: int) -> None:
    """Dictionaries are numbered from zero to the last known one; a board has at least three squares each way."""
    board = {"cols": 3, "rows": 3, "chessboard_dim": 0.04, "aruco_marker_dim": 0.02}
    found = module._charuco(finder(**board, dictionary=number))
    assert (found["squares"], found["dictionary"]) == ([3, 3], DICTIONARIES[number])
    for wrong in (-1, 21):
        with pytest.raises(DatasetError, match="expected"):
            module._charuco(finder(**board, dictionary=wrong))
    for name in ("cols", "rows"):
        with pytest.raises(DatasetError, match="is 2, expected a whole number from 3"):
            module._charuco(finder(**{**board, name: 2}, dictionary=0))


def test_circle_grids_need_two_circles_each_way() -> None:
    """Fewer columns or rows are refused."""
    assert module._circles(finder(cols=2, rows=2, spacing=0.03))["circles"] == [2, 2]
    for name in ("cols", "rows"):
        with pytest.raises(DatasetError, match="is 1, expected a whole number from 2"):
            module._circles(finder(**{"cols": 2, "rows": 2, name: 1}, spacing=0.03))
