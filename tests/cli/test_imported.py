"""What every import says at its end."""

from __future__ import annotations

from pathlib import Path

import pytest

from basecal.cell import RobotState
from basecal.cell.files import read_recording
from basecal.cli.imported import finish_import
from basecal.errors import InputError
from basecal.exchange.importing.imported import Imported, Row
from basecal.geometry import SE3


def poses(robot: str, count: int, scale: float = 1.0) -> Imported:
    states = [RobotState(SE3.from_rotvec([0, 0, 0.1], [0.4 * scale, 0.1 * i * scale, 0])) for i in range(count)]
    cell = {"robots": {robot: {}}} | ({"reference": "left"} if robot == "left" else {})
    return Imported(f"{robot}.csv", f"{count} poses", tuple(Row({robot: state}) for state in states), cell)


def test_it_says_what_was_read_and_what_comes_next(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Source, pairing, what changed in the cell, and the next command, a line each."""
    assert finish_import(tmp_path, poses("left", 3), advice="") == 0
    first = capsys.readouterr().out.splitlines()
    assert first[0] == "read left.csv: 3 poses"
    assert first[-1].startswith(f"wrote 3 samples and cell.yaml to {tmp_path}: next, its pictures: basecal import im")
    assert finish_import(tmp_path, poses("right", 3), advice="") == 0
    assert capsys.readouterr().out.splitlines()[1:3] == [
        "paired with 3 samples in order",
        "written into cell.yaml: robots.right",
    ]


def test_what_cannot_be_is_refused_with_advice(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Millimetres taken for metres leave nothing behind and are told how to be read; where not strict they are told."""
    far = poses("left", 3, 1000.0)
    with pytest.raises(InputError, match=r"left.csv: flange of left 447 m: .* nothing is imported; try mm"):
        finish_import(tmp_path / "c", far, advice="try mm")
    assert not (tmp_path / "c").exists()
    assert finish_import(tmp_path / "c", far, advice="try mm", is_strict=False) == 0
    assert "warning: left.csv: flange of left" in capsys.readouterr().err
    assert len(read_recording(tmp_path / "c").samples) == 3
