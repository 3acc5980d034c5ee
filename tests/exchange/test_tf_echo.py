"""Tests of the output of tf2_echo."""

from __future__ import annotations

from pathlib import Path

import pytest

from basecal.cell.files import read_recording
from basecal.cli import main
from basecal.exchange.tf_echo import transform_rows

ECHO = """\
At time 1700000000.120
- Translation: [0.500, -0.100, 0.400]
- Rotation: in Quaternion (xyzw) [0.000, 0.600, 0.000, 0.800]
- Rotation: in RPY (radian) [0.000, 1.287, 0.000]
- Matrix:
  0.280  0.000  0.960  0.500
"""


def test_transform_row_is_in_line_of_its_rotation() -> None:
    """The output of ROS 2 and ROS 1 is read; other texts give no rows."""
    row = "0.500, -0.100, 0.400, 0.000, 0.600, 0.000, 0.800"
    assert transform_rows(ECHO).split("\n") == ["", "", row, "", "", ""]
    assert row in transform_rows(ECHO.replace(" (xyzw)", ""))
    assert transform_rows("x y z qx qy qz qw\n" + row) == ""
    assert transform_rows("\n".join(reversed(ECHO.splitlines()))) == ""


def test_equal_readings_of_resting_arm_are_one(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """tf2_echo runs until it is stopped: readings equal up to their last digit are one."""
    cell, still = str(tmp_path / "c"), tmp_path / "still.txt"
    (tmp_path / "a.csv").write_text("x,y,z,qx,qy,qz,qw\n" + "".join(f"0.{k},0.1,0.3,0,0,0,1\n" for k in (4, 5, 6)))
    still.write_text(ECHO + ECHO.replace("0.500", "0.501"))
    words = ["import", "poses", cell, "--format", "ros", "--robot"]
    assert main([*words, "a", str(tmp_path / "a.csv")]) == 0
    assert main([*words, "b", str(still), "--still"]) == 0
    poses = [sample.robots["b"].base_from_flange for sample in read_recording(cell).samples]
    assert [pose.translation.tolist() for pose in poses if pose is not None] == 3 * [[0.5, -0.1, 0.4]]
    still.write_text(ECHO + ECHO.replace("0.500", "0.510"))
    assert main([*words, "c", str(still), "--still"]) == 3
    assert "still.txt: holds 2 rows that differ: --still is for an arm at rest" in capsys.readouterr().err


def test_each_rotation_uses_last_translation() -> None:
    """A rotation uses the last translation before it, and each translation belongs to one rotation."""
    moved, turned = "- Translation: [{}, 0, 0]", "- Rotation: in Quaternion [0, 0, 0, {}]"
    lines = [
        moved.format(1),
        moved.format(2),
        "At time 3",
        turned.format(1),
        turned.format(2),
        moved.format(3),
        turned.format(3),
    ]
    assert transform_rows("\n".join(lines)).split("\n") == [
        "",
        "",
        "",
        "2, 0, 0, 0, 0, 0, 1",
        "",
        "",
        "3, 0, 0, 0, 0, 0, 3",
    ]
