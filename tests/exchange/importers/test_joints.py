"""Tests of `basecal import joints`: joints with their URDF."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from tests.shared.real_recordings import data_folder

from basecal.cell.files import read_cell, read_recording
from basecal.cli import main
from basecal.exchange.urdf import chain_urdf
from basecal.kinematics import SerialChain


@pytest.fixture
def motoman() -> Path:
    """Folder of two Motoman arms with their URDFs, as recorded."""
    folder = data_folder() / "motoman_dual_joints"
    if not folder.exists():
        pytest.skip(f"{folder} is not there: set BASECAL_DATA to the folder of the published recordings")
    return folder


def table(motoman: Path, path: Path, robot: str, factor: float = 1.0) -> tuple[str, np.ndarray]:
    samples = [sample for sample in read_recording(motoman).samples if robot in sample.robots][:20]
    joints = np.array([sample.robots[robot].joints_rad for sample in samples])
    np.savetxt(path, factor * joints, delimiter=";")
    return str(path), joints


def test_real_arm_in_degrees_is_imported(motoman: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Its joints are read in radians with its URDF beside them; a wrong unit is refused by the joint limits."""
    robot = read_cell(motoman).robots["left"]
    assert robot.urdf is not None
    model = ["--urdf", str(motoman / robot.urdf), "--base-link", robot.base_link, "--flange-link", robot.flange_link]
    path, joints = table(motoman, tmp_path / "q.csv", "left", np.degrees(1.0))
    base = ["import", "joints", str(tmp_path / "c"), "--robot", "left", path]
    assert main([*base, *model]) == 3
    assert "give --deg, they look like degrees" in capsys.readouterr().err
    assert not (tmp_path / "c").exists()
    assert main([*base, *model, "--deg"]) == 0
    assert (tmp_path / "c" / robot.urdf).read_bytes() == (motoman / robot.urdf).read_bytes()
    found = [sample.robots["left"].joints_rad for sample in read_recording(tmp_path / "c").samples]
    np.testing.assert_allclose(found, joints, atol=1e-9)
    right, _ = table(motoman, tmp_path / "r.csv", "right")
    assert main(["import", "joints", str(tmp_path / "c"), "--robot", "right", right]) == 3
    assert "has no URDF of 'right', which joints need: give --urdf FILE" in capsys.readouterr().err


def test_urdf_needs_its_links(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A URDF without its links is a usage error."""
    words = ["import", "joints", str(tmp_path / "c"), "--robot", "left", "q.csv", "--urdf", "a.urdf"]
    assert main(words) == 2
    assert "go together: give all three" in capsys.readouterr().err


def test_joint_offset_prior_is_written(tmp_path: Path, arm: SerialChain) -> None:
    """The prior is added with the URDF or later, in radians; a value that contradicts the stated one is an error."""
    (tmp_path / "arm.urdf").write_text(chain_urdf(arm, "base", "tool"))
    (tmp_path / "j.csv").write_text("0,10,20,30,40,50\n1,11,21,31,41,51\n")
    base = ["import", "joints", str(tmp_path / "c"), str(tmp_path / "j.csv"), "--robot", "left", "--deg"]
    base += ["--urdf", str(tmp_path / "arm.urdf"), "--base-link", "base", "--flange-link", "tool"]
    assert main([*base, "--offset-sigma-deg", "2"]) == 0
    stated = read_cell(tmp_path / "c").robots["left"].parameters["joint_offsets"]
    assert stated.status == "prior"
    assert stated.model_dump()["sigma_rad"] == pytest.approx(np.radians(2), abs=1e-5)
    assert main([*base, "--offset-sigma-deg", "0"]) == 2


def test_stationary_arm_has_one_row(tmp_path: Path, arm: SerialChain) -> None:
    """Its joints apply to every sample of the moving arm."""
    (tmp_path / "arm.urdf").write_text(chain_urdf(arm, "base", "tool"))
    rows = np.radians([[0, -90, 90, 10, -20, 30], [5, -80, 80, 12, -22, 33], [9, -70, 70, 14, -24, 36]])
    np.savetxt(tmp_path / "moves.csv", rows, delimiter=",")
    np.savetxt(tmp_path / "rests.csv", rows[:1], delimiter=",")
    base = ["import", "joints", str(tmp_path / "c"), "--robot"]
    model = ["--urdf", str(tmp_path / "arm.urdf"), "--base-link", "base", "--flange-link", "tool"]
    assert main([*base, "left", str(tmp_path / "moves.csv"), *model]) == 0
    assert main([*base, "right", str(tmp_path / "rests.csv"), *model, "--still"]) == 0
    found = [sample.robots["right"].joints_rad for sample in read_recording(tmp_path / "c").samples]
    np.testing.assert_allclose(found, np.tile(rows[0], (3, 1)))
