"""Journey of a ROS 2 lab: poses from tf, images named by their stamps, and samples of easy_handeye2."""

from __future__ import annotations

import ast
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from basecal.geometry import SE3, Array
from tests.journeys.raw import (
    BOARD_OPTIONS,
    FIRST_STAMP_NS,
    cell,
    is_pasted,
    is_within_three_sigmas,
    photographs,
    recorded,
    run,
    written,
)

pytestmark = pytest.mark.slow
NAME = "left_base_from_right_base"
PERIOD_NS = 3_000_000_000
LATE_NS = 4_000_000  # of tf after an image


def trajectory(positions: Array, turns: Rotation) -> list[str]:
    """Poses in the format of TUM's RGB-D benchmark, as written by evo and rosbag tools: stamp x y z qx qy qz qw."""
    stamps = FIRST_STAMP_NS + LATE_NS + PERIOD_NS * np.arange(len(positions))
    rows = zip(stamps, np.column_stack([positions, turns.as_quat()]), strict=True)
    lines = [f"{stamp / 1e9:.6f} " + " ".join(f"{number:.9f}" for number in row) for stamp, row in rows]
    return ["# timestamp tx ty tz qx qy qz qw", *lines]


def published(text: str) -> SE3:
    """Transform in a launch file's static_transform_publisher."""
    words = [each.value for each in ast.walk(ast.parse(text)) if isinstance(each, ast.Constant)]
    told = {str(a)[2:]: b for a, b in pairwise(words) if str(a).startswith("--")}
    assert (told["frame-id"], told["child-frame-id"]) == ("left_base", "right_base")
    turn = Rotation.from_quat([float(str(told[key])) for key in ("qx", "qy", "qz", "qw")])
    return SE3(turn.as_matrix(), np.array([float(str(told[key])) for key in "xyz"]))


def test_from_tf_and_stamped_images_to_a_launch_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Trajectories and images are paired by time; the answer is published on /tf_static."""
    monkeypatch.chdir(tmp_path)
    made = cell(samples=15, seed=11)
    photographs(made, tmp_path, lambda i: f"{FIRST_STAMP_NS + i * PERIOD_NS}.png")
    written(tmp_path / "left.txt", trajectory(*recorded(made, "eye")))
    # The other arm was recorded for longer: what no image belongs to is left out.
    more = recorded(cell(samples=16, seed=11), "hand")
    right = [*trajectory(*recorded(made, "hand")), *trajectory(*more)[-1:]]
    written(tmp_path / "right.txt", right)
    run(
        f"basecal import images mycell photos --camera wrist --on left {BOARD_OPTIONS} --target-on right --by time",
        "basecal import poses mycell --robot left left.txt --format ros",
        "basecal import poses mycell --robot right right.txt --format ros",
        "basecal calibrate mycell",
        "basecal export mycell --to ros2 -o cell.launch.py",
    )
    printed = capsys.readouterr().out
    assert "GOOD: expected error " in printed
    assert f"\n{NAME} to " in printed
    assert is_within_three_sigmas(tmp_path / "mycell", NAME, made.truth["eye_base_from_hand_base"])
    assert is_pasted(published((tmp_path / "cell.launch.py").read_text()), tmp_path / "mycell", NAME)
