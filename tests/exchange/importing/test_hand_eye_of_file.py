"""Tests of hand-eye recordings read for the cell in a folder."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from basecal.cell.files import read_cell, read_recording
from basecal.cli import main
from basecal.cli.importing import finish_import
from basecal.exchange.importing.hand_eye import Carriers, HandEyeRecord, hand_eye_of_file
from basecal.geometry import SE3

POSES = SE3.exp(np.random.default_rng(4).normal(size=(2, 3, 6)) * 0.3)


def make_record(on_robot: bool | None) -> HandEyeRecord:
    return HandEyeRecord("s.yaml", "3 pairs of poses", bool(on_robot), POSES[0], POSES[1])


@pytest.mark.parametrize(("carrier", "camera"), [("robot", "eye"), ("world", "world")])
def test_hand_eye_file_becomes_cell(
    tmp_path: Path, carrier: str, camera: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """The camera has the stated carrier, the target the other; all samples are imported."""
    asked = []

    def read(on_robot: bool | None) -> HandEyeRecord:
        asked.append(on_robot)
        return make_record(on_robot)

    read_record = hand_eye_of_file(tmp_path / "c", read, Carriers(carrier), None, None, None)
    assert finish_import(tmp_path / "c", read_record) == 0
    assert asked == [carrier == "robot"]
    cell, samples = read_cell(tmp_path / "c"), read_recording(tmp_path / "c").samples
    assert [each.on for each in cell.cameras.values()] == [camera]
    assert [each.on for each in cell.targets.values()] == ["world" if camera == "eye" else "hand"]
    assert len(samples) == 3
    (state,) = samples[1].robots.values()
    assert state.base_from_flange is not None
    np.testing.assert_allclose(state.base_from_flange.matrix, POSES[0, 1].matrix, atol=1e-12)
    assert "conventions are not determined by 3 views" in capsys.readouterr().out


def test_existing_cell_determines_carrier(tmp_path: Path) -> None:
    """The carrier is taken from the cell without a request, and its names are used."""
    assert main(["new", str(tmp_path / "c"), "--robots", "1", "--target", "pose", "--names", "left"]) == 0
    asked = []

    def read(on_robot: bool | None) -> HandEyeRecord:
        asked.append(on_robot)
        return make_record(on_robot)

    assert finish_import(tmp_path / "c", hand_eye_of_file(tmp_path / "c", read, Carriers(), None, None, None)) == 0
    assert asked == [True]
    assert [*read_recording(tmp_path / "c").samples[0].robots] == ["left"]
