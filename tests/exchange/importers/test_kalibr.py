"""Tests of `basecal import kalibr`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from basecal.cell.files import read_cell
from basecal.cli import main
from basecal.errors import DatasetError
from basecal.exchange.importers.kalibr import is_target, read_camchain, read_target
from lens_texts import KALIBR, reads_lens

CHAIN = """\
cam0:
  T_cam_imu:
  - [0.0, 1.0, 0.0, 0.07]
  - [-1.0, 0.0, 0.0, -0.02]
  - [0.0, 0.0, 1.0, 0.004]
  - [0.0, 0.0, 0.0, 1.0]
  cam_overlaps: [1]
  camera_model: pinhole
  distortion_coeffs: [-0.277, 0.067, 0.0009, 0.0001]
  distortion_model: radtan
  intrinsics: [461.629, 460.152, 362.68, 246.049]
  resolution: [752, 480]
  rostopic: /cam0/image_raw
  timeshift_cam_imu: -8.121e-05
cam1:
  T_cn_cnm1:
  - [1.0, 0.0, 0.0, -0.11]
  - [0.0, 0.0, -1.0, 0.002]
  - [0.0, 1.0, 0.0, 0.003]
  - [0.0, 0.0, 0.0, 1.0]
  cam_overlaps: [0]
  camera_model: pinhole
  distortion_coeffs: [-0.027, 0.095, -0.113,
    0.051]
  distortion_model: equidistant
  intrinsics: [458.655, 457.296, 367.215, 248.375]
  resolution: [752, 480]
  rostopic: /cam1/image_raw
"""
APRILGRID = """\
target_type: 'aprilgrid' #gridtype
tagCols: 6               #number of apriltags
tagRows: 5               #number of apriltags
tagSize: 0.088           #size of apriltag, edge to edge [m]
tagSpacing: 0.3          #ratio of space between tags to tagSize
"""


def test_lens_is_imported_into_new_cell(tmp_path: Path) -> None:
    """A camera of a new cell has the lens."""
    assert reads_lens(tmp_path, "kalibr", "a.yaml", KALIBR.format(name="cam0"))


def test_camera_and_target_of_kalibr_are_chosen(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """One of several cameras is chosen by its name in the file; a target is added to the same cell."""
    (tmp_path / "chain.yaml").write_text(KALIBR.format(name="cam0") + KALIBR.format(name="cam1"))
    cell = str(tmp_path / "c")
    words = ["import", "kalibr", cell, str(tmp_path / "chain.yaml"), "--camera", "wrist", "--on", "left"]
    assert main(words) == 3
    assert "has cam0, cam1: choose one with --camera-of-file" in capsys.readouterr().err
    assert main([*words, "--camera-of-file", "cam1"]) == 0
    (tmp_path / "t.yaml").write_text(
        "target_type: 'aprilgrid'\ntagCols: 6\ntagRows: 5\ntagSize: 0.088\ntagSpacing: 0.3\n"
    )
    assert main(["import", "kalibr", cell, str(tmp_path / "t.yaml"), "--target", "grid", "--on", "world"]) == 0
    target = read_cell(cell).targets["grid"].target
    assert target is not None
    assert dict(target.options)["tags"] == [6, 5]


def write(folder: Path, text: str) -> Path:
    path = folder / "kalibr.yaml"
    path.write_text(text, encoding="utf-8")
    return path


def test_camera_chain_of_two_is_read(tmp_path: Path) -> None:
    """Radtan is the pinhole model, equidistant the fisheye.

    The second camera has the pose of T_cn_cnm1, and the IMU is ignored.
    """
    first, second = read_camchain(write(tmp_path, CHAIN))
    assert (first.name, first.camera.model, first.camera.size_px) == ("cam0", "pinhole", (752, 480))
    np.testing.assert_array_equal(
        first.camera.parameters, [461.629, 460.152, 362.68, 246.049, -0.277, 0.067, 0.0009, 0.0001]
    )
    assert first.camera_from_previous is None
    assert second.camera.model == "fisheye"
    assert second.camera_from_previous is not None
    np.testing.assert_allclose(second.camera_from_previous.translation, [-0.11, 0.002, 0.003])
    np.testing.assert_allclose(second.camera_from_previous.rotation[1], [0, 0, -1], atol=1e-12)


def test_lens_without_distortion_has_no_terms(tmp_path: Path) -> None:
    """The distortion model `none` has no terms."""
    text = CHAIN[: CHAIN.index("cam1:")].replace("radtan", "none").replace("[-0.277, 0.067, 0.0009, 0.0001]", "[]")
    assert len(read_camchain(write(tmp_path, text))[0].camera.distortion) == 0


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            "camera_model: pinhole",
            "camera_model: omni",
            ":8: cam0.camera_model: 'omni' is not supported: .* pinhole-radt",
        ),
        ("radtan", "fov", "'fov' is not supported; there are: radtan, equidistant, none"),
        ("[752, 480]", "[752]", "cam0.resolution: has 1 number, expected width and height"),
        ("[-0.277, 0.067, 0.0009, 0.0001]", "[-0.277, 0.067]", "distortion_coeffs: has 2 numbers, expected 4"),
        ("[461.629,", "[oops,", r":11: cam0.intrinsics\[0\]: is 'oops', expected a number"),
        ("- [0.0, 0.0, -1.0, 0.002]", "- [0.0, 0.0, 1.0, 0.002]", "cam1.T_cn_cnm1: .*not a rotation"),
        ("cam", "kam", "a camchain of Kalibr has cam0, cam1, ...; a target of it has target_type"),
    ],
)
def test_unsupported_camera_chains_are_reported(tmp_path: Path, old: str, new: str, message: str) -> None:
    """Each error has the line and field, and what to do."""
    assert old in CHAIN
    with pytest.raises(DatasetError, match=message):
        read_camchain(write(tmp_path, CHAIN.replace(old, new)))


def test_kalibr_targets_are_read(tmp_path: Path) -> None:
    """Each kind is read as the cell describes it, with columns before rows."""
    assert is_target(write(tmp_path, APRILGRID))
    grid = {"kind": "aprilgrid", "tags": [6, 5], "tag_m": 0.088, "spacing": 0.3, "family": "tag36h11"}
    assert read_target(write(tmp_path, APRILGRID)) == grid
    board = "target_type: checkerboard\ntargetCols: 6\ntargetRows: 7\nrowSpacingMeters: 0.06\ncolSpacingMeters: 0.06\n"
    assert read_target(write(tmp_path, board)) == {"kind": "chessboard", "corners": [6, 7], "square_m": 0.06}
    circles = "target_type: circlegrid\ntargetCols: 6\ntargetRows: 7\nspacingMeters: 0.02\nasymmetricGrid: true\n"
    expected = {"kind": "circles", "circles": [6, 7], "spacing_m": 0.02, "asymmetric": True}
    assert read_target(write(tmp_path, circles)) == expected
    assert not is_target(write(tmp_path, CHAIN))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("target_type: hexgrid\n", ":1: target_type: 'hexgrid' is not a target of Kalibr; there are: aprilgrid"),
        (APRILGRID + "codeOffset: 3\n", "start with number 0"),
        (APRILGRID.replace("tagCols: 6 ", "tagCols: 6.5 "), "tagCols: is 6.5, expected a whole number"),
        (
            "target_type: checkerboard\ntargetCols: 6\ntargetRows: 7\nrowSpacingMeters: 0.06\ncolSpacingMeters: 0.05\n",
            "fields of a board must be square",
        ),
    ],
)
def test_unsupported_targets_are_reported(tmp_path: Path, text: str, message: str) -> None:
    """Targets that basecal lacks, and invalid numbers, are errors."""
    with pytest.raises(DatasetError, match=message):
        read_target(write(tmp_path, text))


@pytest.mark.parametrize(("kind", "rest", "key"), [
    ("checkerboard", "rowSpacingMeters: 0.06\ncolSpacingMeters: 0.06\n", "corners"),
    ("circlegrid", "spacingMeters: 0.02\n", "circles"),
])  # fmt: skip
def test_grids_need_two_rows_and_columns(tmp_path: Path, kind: str, rest: str, key: str) -> None:
    """Two columns by two rows are the minimum; an asymmetric grid has to state it."""
    text = f"target_type: {kind}\ntargetCols: 2\ntargetRows: 2\n{rest}"
    found = read_target(write(tmp_path, text))
    assert found[key] == [2, 2]
    assert not found.get("asymmetric")
    for name in ("targetCols", "targetRows"):
        with pytest.raises(DatasetError, match=f"{name}: is 1, expected a whole number from 2"):
            read_target(write(tmp_path, text.replace(f"{name}: 2", f"{name}: 1")))


@pytest.mark.parametrize(
    ("down", "is_square"),
    [("0.06", True), ("0.06000005", True), ("0.05999995", True), ("0.0600001", False), ("0.0599999", False)],
)
def test_board_squares_are_square_to_a_millionth(tmp_path: Path, down: str, is_square: bool) -> None:
    """The column spacing is the side; the row spacing may differ only by rounding."""
    board = (
        f"target_type: checkerboard\ntargetCols: 6\ntargetRows: 7\nrowSpacingMeters: {down}\ncolSpacingMeters: 0.06\n"
    )
    if is_square:
        assert read_target(write(tmp_path, board))["square_m"] == 0.06
    else:
        with pytest.raises(DatasetError, match=f"rowSpacingMeters: is {down}, colSpacingMeters 0.06: fields"):
            read_target(write(tmp_path, board))


def test_aprilgrid_of_one_tag_is_read(tmp_path: Path) -> None:
    """One tag each way is a grid; `codeOffset: 0` has no effect."""
    one = APRILGRID.replace("tagCols: 6", "tagCols: 1").replace("tagRows: 5", "tagRows: 1")
    assert read_target(write(tmp_path, one + "codeOffset: 0\n"))["tags"] == [1, 1]
