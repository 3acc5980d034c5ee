"""`basecal import arrays`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from basecal.cell.files import read_cell, read_recording
from basecal.cli import main
from basecal.geometry import SE3

MOUNT, BASE = SE3.exp([0.03, -0.05, 0.06, 0.2, -0.4, 0.3]), SE3.exp([1.2, 0.1, 0.0, 0.0, 0.1, 2.5])
EYE, SEEN = (SE3.exp([0, 0, 0.5, 0, 0, 0] + 0.3 * np.random.default_rng(k).normal(size=(12, 6))) for k in range(2))
HAND = BASE.inverse() @ EYE @ MOUNT @ SEEN

ONE_ARM = {"gripper2base": MOUNT @ SEEN, "target2cam": SEEN}


def _saved(path: Path, **poses: SE3) -> None:
    arrays = {}
    for name, pose in poses.items():
        arrays[f"R_{name}"], arrays[f"t_{name}"] = pose.rotation, pose.translation
    np.savez(path, **arrays)


def test_one_arm_and_its_next_step(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """An archive makes a cell of one arm, ready to be calibrated."""
    _saved(tmp_path / "poses.npz", gripper2base=MOUNT @ SEEN, target2cam=SEEN)
    assert main(["import", "arrays", str(tmp_path / "cell"), str(tmp_path / "poses.npz"), "--camera-on", "world"]) == 0
    told = capsys.readouterr().out
    assert "12 samples under OpenCV's names: R_gripper2base" in told
    cell = read_cell(tmp_path / "cell")
    assert set(cell.transforms) == {"hand_base_from_camera", "hand_flange_from_target"}


def test_the_option_of_the_unit_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Millimetres that are read as metres are refused with the option that reads them."""
    in_mm = {name: SE3(pose.rotation, 1e3 * pose.translation) for name, pose in ONE_ARM.items()}
    _saved(tmp_path / "poses.npz", **in_mm)
    words = ["import", "arrays", str(tmp_path / "cell"), str(tmp_path / "poses.npz")]
    assert main(words) == 3
    assert "all lengths are read in m: check --unit, or convert arrays of another unit;" in capsys.readouterr().err
    assert main([*words, "--unit", "mm"]) == 0


def test_two_arms_by_name(tmp_path: Path) -> None:
    """The poses of two arms go to the robots that are named."""
    _saved(tmp_path / "poses.npz", eye_gripper2base=EYE, hand_gripper2base=HAND, target2cam=SEEN)
    names = ["--robot", "left", "--hand", "right"]
    assert main(["import", "arrays", str(tmp_path / "cell"), str(tmp_path / "poses.npz"), *names]) == 0
    cell = read_cell(tmp_path / "cell")
    assert "left_base_from_right_base" in cell.transforms
    state = read_recording(tmp_path / "cell", cell).samples[2].robots["right"]
    np.testing.assert_allclose(state.base_from_flange.matrix, HAND[2].matrix, atol=1e-9)


def test_a_file_that_is_none(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A list where arrays by name are expected leaves nothing behind."""
    (tmp_path / "poses.json").write_text("[1, 2]")
    assert main(["import", "arrays", str(tmp_path / "cell"), str(tmp_path / "poses.json")]) == 3
    assert "expected a mapping of arrays by OpenCV's names" in capsys.readouterr().err
    assert not (tmp_path / "cell").exists()
