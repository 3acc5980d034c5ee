"""`basecal fix`."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from basecal.cell import RobotState
from basecal.cell.files import latest_run, read_calibration, write_cell, write_recording
from basecal.cli import main
from basecal.simulation import Scenario, SimulatedCell, simulate


@pytest.fixture(scope="module")
def inverted(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, SimulatedCell]:
    """A cell whose hand was recorded inverted."""
    folder = tmp_path_factory.mktemp("inverted")
    made = simulate(Scenario(samples=12, robot_noise=(1e-4, 2e-4)), 5)
    samples = tuple(
        replace(s, robots={**s.robots, "hand": RobotState(s.robots["hand"].base_from_flange.inverse())})
        for s in made.recording.samples
    )
    write_cell(made.cell, folder)
    write_recording(replace(made.recording, samples=samples), folder)
    return folder, made


@pytest.mark.slow  # two calibrations with all their checks
def test_a_diagnosis_is_fixed(inverted: tuple[Path, SimulatedCell], capsys: pytest.CaptureFixture[str]) -> None:
    """The preview shows it, nothing changes without a word, and the answer is then that of the sound recording."""
    folder, made = inverted
    assert main(["calibrate", str(folder)]) == 4
    assert "Or let `basecal fix CELL` do so." in " ".join(capsys.readouterr().out.split())
    before = (folder / "recording" / "samples.jsonl").read_bytes()
    assert main(["fix", str(folder)]) == 2
    told = capsys.readouterr()
    assert "1. Undo: the poses of hand are inverted (flange_from_base). [robot-pose-inverted]" in told.out
    assert "Add --yes to apply it" in told.err
    assert (folder / "recording" / "samples.jsonl").read_bytes() == before
    assert main(["fix", str(folder), "--choose", "2", "--yes"]) == 2
    assert "there are fixes 1 to 1" in capsys.readouterr().err
    assert main(["fix", str(folder), "--yes"]) == 0
    assert "GOOD" in capsys.readouterr().out
    found = read_calibration(latest_run(folder) / "calibration.json")["eye_base_from_hand_base"]
    off = (found.mean.inverse() @ made.truth["eye_base_from_hand_base"]).log()
    assert abs(off[:3]).max() < 5e-3
    assert main(["fix", str(folder)]) == 0
    assert "nothing to fix: good" in capsys.readouterr().out
