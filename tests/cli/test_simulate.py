"""Tests of `basecal simulate`."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from basecal.cell.files import read_cell, read_recording, read_truth
from basecal.cli import main


@pytest.mark.parametrize("robots", [1, 2, 3])
@pytest.mark.parametrize("target", ["charuco", "led", "pose", "points3d"])
def test_simulated_cells_can_be_read(
    tmp_path: Path, robots: int, target: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """A simulated cell has the requested samples, and a true value of each transform."""
    words = ["simulate", str(tmp_path), "--robots", str(robots), "--target", target, "--samples", "6", "--json"]
    assert main(words) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["samples"] == len(read_recording(tmp_path).samples) > 0
    assert read_truth(tmp_path).keys() == read_cell(tmp_path).transforms.keys()


def test_simulated_noise_is_stated(tmp_path: Path) -> None:
    """Noise given on the command line is stated in the cell in SI units."""
    main(["simulate", str(tmp_path), "--robot-noise-mm", "0.3", "--robot-noise-mrad", "0.5", "--pixel-px", "0.4"])
    cell = read_cell(tmp_path)
    np.testing.assert_allclose(cell.robots["eye"].noise, [3e-4] * 3 + [5e-4] * 3)
    assert cell.pixel_px == 0.4


def test_joint_offsets_need_joints(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Offsets of joints that are not recorded are refused, not ignored."""
    assert main(["simulate", str(tmp_path / "cell"), "--joint-offset-deg", "0.2"]) == 2
    assert "--joint-offset-deg has no effect on recorded poses: add --joints" in capsys.readouterr().err
    assert not (tmp_path / "cell").exists()


def test_faults_need_a_running_cell(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A fault of a recorded cell is refused, not ignored."""
    assert main(["simulate", str(tmp_path / "cell"), "--fault", "backlash"]) == 2
    assert "without --process no cell runs: leave --fault out" in capsys.readouterr().err
    assert not (tmp_path / "cell").exists()
