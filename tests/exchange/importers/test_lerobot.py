"""`basecal import lerobot`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from tests.exchange.test_lerobot import DEGREES, dataset, names_of

from basecal.cell.files import read_recording
from basecal.cli import main
from basecal.exchange.urdf import chain_urdf
from basecal.kinematics import SerialChain

pytest.importorskip("pyarrow")


def test_a_dataset_makes_a_cell(tmp_path: Path, arm: SerialChain, capsys: pytest.CaptureFixture[str]) -> None:
    """Joints in radians with the URDF beside them; in the wrong unit they are refused."""
    (tmp_path / "arm.urdf").write_text(chain_urdf(arm, "base", "tool"))
    data = dataset(tmp_path / "d", names_of(arm))
    base = ["import", "lerobot", str(tmp_path / "c"), str(data), "--robot", "left", "--every-s", "0"]
    base += ["--urdf", str(tmp_path / "arm.urdf"), "--base-link", "base", "--flange-link", "tool"]
    assert main([*base, "--unit", "rad"]) == 3
    assert "nothing is imported; check --unit" in capsys.readouterr().err
    assert main([*base, "--unit", "deg"]) == 0
    assert "3 of 3 frames of episode 0: joints of 'left' in deg" in capsys.readouterr().out
    found = [sample.robots["left"].joints_rad for sample in read_recording(tmp_path / "c").samples]
    np.testing.assert_allclose(np.degrees(found), DEGREES[:, :6], atol=1e-9)
    assert main([*base, "--unit", "deg", "--calibration", "x.json"]) == 2
