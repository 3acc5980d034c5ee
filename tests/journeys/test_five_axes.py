"""Journey: two hobby arms of five axes are calibrated like others, and reachable samples are planned."""

from __future__ import annotations

import json

import numpy as np
import pytest
from scipy.stats import chi2

from basecal.cell.files import latest_run, read_calibration
from basecal.cli import main
from tests.shared.five_axes import ARM, BASE, FARTHEST_M, NEAREST_M, write_board_between, write_five_axis_cell


def test_arms_of_five_axes_are_calibrated_and_planned(tmp_path, capsys):
    """The answer is good and within its 99.9 % ellipsoid.

    Planned samples are within the limits and as near as recorded ones.
    """
    place = tmp_path / "mycell"
    true = write_five_axis_cell(place, 0)
    assert main(["calibrate", str(place)]) == 0
    answer = read_calibration(latest_run(place) / "calibration.json")
    base = answer[BASE]
    off = (true.inverse() @ base.mean).log()
    assert answer.verdict == "good"
    assert off @ np.linalg.solve(base.covariance, off) < chi2.ppf(0.999, 6)
    planned = tmp_path / "plan.jsonl"
    assert main(["plan", str(place), "--samples", "6", "-o", str(planned)]) == 0
    samples = [json.loads(line)["robots"] for line in planned.read_text().splitlines()]
    assert len(samples) == 6
    for robots in samples:
        left, right = (np.array(robots[name]["joints_rad"]) for name in ("left", "right"))
        assert ((ARM.lower <= left) & (left <= ARM.upper)).all()
        assert ((ARM.lower <= right) & (right <= ARM.upper)).all()
        wrist, board = answer["left_flange_from_wrist"].mean, answer["right_flange_from_board"].mean
        eye = ARM.forward(left) @ wrist
        camera_from_board = eye.inverse() @ base.mean @ ARM.forward(right) @ board
        assert NEAREST_M - 0.05 < camera_from_board.translation[2] < FARTHEST_M + 0.5


@pytest.mark.parametrize("seed", [0, 1])
def test_camera_on_each_wrist_with_a_board_between(tmp_path, seed):
    """Each arm is recorded and planned separately; the answer is good and within 99.9 %."""
    place = tmp_path / "mycell"
    true = write_board_between(place, seed)
    assert main(["calibrate", str(place)]) == 0
    base = read_calibration(latest_run(place) / "calibration.json")[BASE]
    off = (true.inverse() @ base.mean).log()
    assert off @ np.linalg.solve(base.covariance, off) < chi2.ppf(0.999, 6)
    planned = tmp_path / "plan.jsonl"
    assert main(["plan", str(place), "--samples", "6", "-o", str(planned)]) == 0
    moved = [list(json.loads(line)["robots"]) for line in planned.read_text().splitlines()]
    assert len(moved) == 6
    assert all(len(robots) == 1 for robots in moved)
