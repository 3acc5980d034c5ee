"""Journey of an integrator with two UR arms, a pendant and a camera: no ROS, and no programs of his own."""

from __future__ import annotations

import ast
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from basecal.geometry import SE3, Array
from tests.journeys.raw import (
    BOARD_OPTIONS,
    cell,
    is_pasted,
    is_within_three_sigmas,
    photographs,
    recorded,
    run,
    written,
)
from tests.shared.real_recordings import data_folder

NAME = "left_base_from_right_base"


def pasted_pose(text: str) -> SE3:
    """Pose in p[...] of URScript: metres and a rotation vector (UR's script manual, `get_actual_tcp_pose`)."""
    line = next(line for line in text.splitlines() if line.startswith("p["))
    numbers = ast.literal_eval(line[1:])
    return SE3(Rotation.from_rotvec(numbers[3:]).as_matrix(), np.array(numbers[:3]))


def teach_pendant(positions: Array, turns: Rotation) -> list[str]:
    """Poses as written by `textmsg(get_actual_tcp_pose())`, one per line."""
    rows = np.column_stack([positions, turns.as_rotvec()])
    return ["p[" + ", ".join(f"{number:.6g}" for number in row) + "]" for row in rows]


def test_from_photographs_to_a_pose_of_urscript(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """From poses of both logs and photographs in order to a pose for the program."""
    monkeypatch.chdir(tmp_path)
    made = cell(samples=15, seed=3)
    photographs(made, tmp_path, lambda i: f"IMG_{i + 1}.png")
    for robot, file in (("eye", "left.txt"), ("hand", "right.txt")):
        written(tmp_path / file, teach_pendant(*recorded(made, robot)))
    run(
        "basecal import poses mycell --robot left left.txt --format ur",
        "basecal import poses mycell --robot right right.txt --format ur",
        f"basecal import images mycell photos --camera wrist --on left {BOARD_OPTIONS}",
        "basecal calibrate mycell",
        "basecal export mycell --to ur -o base.script",
    )
    printed = capsys.readouterr().out
    assert "GOOD: expected error " in printed
    assert f"\n{NAME} to " in printed
    place = tmp_path / "mycell"
    assert is_within_three_sigmas(place, NAME, made.truth["eye_base_from_hand_base"])
    assert is_pasted(pasted_pose((tmp_path / "base.script").read_text()), place, NAME)


@pytest.mark.slow
def test_real_photographs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """Two published UR5e with 4x4 files and photographs: the base is within 10 mm and 0.4 deg of the published one."""
    source = data_folder() / "ur5e_dual_charuco_2023"
    if not source.exists():
        pytest.skip(f"{source} is not there: set BASECAL_DATA to the folder of the published recordings")
    monkeypatch.chdir(tmp_path)
    run(
        f"basecal import poses mycell --robot left {source / 'r2_tf.txt'} --format matrix",
        f"basecal import poses mycell --robot right {source / 'r1_tf.txt'} --format matrix",
        f"basecal import images mycell {source / 'images'} --camera wrist --on left "
        "--target charuco --squares 5x7 --square 40mm --marker 28.8mm",
        "basecal calibrate mycell",
        "basecal export mycell --to ur -o base.script",
    )
    printed = capsys.readouterr().out
    assert "GOOD: expected error " in printed
    assert f"\n{NAME} to " in printed
    published = SE3.from_rotvec(np.radians([0.07, -0.24, 0.09]), [1.3254, 0.0012, -0.0031])
    error = published.inverse() @ pasted_pose((tmp_path / "base.script").read_text())
    assert np.linalg.norm(error.translation) < 0.010
    assert np.degrees(np.linalg.norm(error.rotvec)) < 0.4
