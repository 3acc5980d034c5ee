"""`export`: the URDF of a robot with its calibration in it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from basecal.cell.files import latest_run, read_calibration, read_cell
from basecal.cli import main
from basecal.exchange.exporters.exporter import exporter
from basecal.kinematics import read_chain
from basecal.registry import EXPORTERS


@pytest.fixture
def off(tmp_path: Path) -> Path:
    """A cell whose joints' zeros are off."""
    folder = tmp_path / "off"
    assert main(["simulate", str(folder), "--joints", "--joint-offset-deg", "0.2"]) == 0
    return folder


def test_a_corrected_urdf_stands_where_the_calibration_says(off: Path, tmp_path: Path) -> None:
    """At recorded joints its flange is that of the cell's chain at joints with the offsets of calibration.json."""
    cell = (off / "cell.yaml").read_text()
    freed = cell.replace(
        "flange_link: tool0}", "flange_link: tool0, joint_offsets: {status: prior, sigma_rad: 0.0035}}"
    )
    (off / "cell.yaml").write_text(freed)
    assert main(["calibrate", str(off)]) == 0
    written = tmp_path / "new" / "hand.urdf"
    assert main(["export", str(off), "--urdf", "hand", "-o", str(written)]) == 0
    run = latest_run(off)
    assert run is not None
    offsets = read_calibration(run).parameters_of("hand")["joint_offsets"].values
    assert np.abs(offsets).max() > 1e-4
    joints = np.random.default_rng(0).uniform(-2, 2, (5, 6))
    chain = read_cell(off).robots["hand"].chain
    assert chain is not None
    corrected = read_chain(written, "base_link", "tool0").forward(joints)
    np.testing.assert_allclose(corrected.matrix, chain.forward(joints + offsets).matrix, atol=1e-13)


def test_it_says_what_is_missing(off: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """No run yet, no such robot, no offsets in the run: one line each, exit code 3, nothing written."""
    words = ["export", str(off), "-o", str(tmp_path / "x.urdf"), "--urdf"]
    assert main([*words, "hand"]) != 0
    assert "has no run yet" in capsys.readouterr().err
    main(["calibrate", str(off)])
    capsys.readouterr()
    assert main([*words, "hand"]) != 0
    assert "no joint offsets of 'hand'" in capsys.readouterr().err
    assert main([*words, "foot"]) != 0
    assert "foot" in capsys.readouterr().err
    assert not (tmp_path / "x.urdf").exists()


@pytest.mark.parametrize("words", [[], ["--sdf", "hand"], ["--urdf", "hand", "--sdf", "hand"]])
def test_one_thing_is_exported(words: list[str], off: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Nothing said, something unknown and two things at once are wrong usage, and what there is is named."""
    assert main(["export", str(off), "-o", str(tmp_path / "x"), *words]) == 2
    told = capsys.readouterr().err
    assert all(f"--{name}" in told for name in EXPORTERS)


@pytest.mark.parametrize("name", EXPORTERS)
def test_every_exporter_is_told(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    """The help of the verb names every exporter, and each is there."""
    main(["export", "--help"])
    assert f"--{name}" in capsys.readouterr().out
    assert callable(exporter(name).exported)
