"""Tests of `basecal compare`."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from tests.shared.stages import without_stages

from basecal.accuracy.stages.concluding import find_error_at_task
from basecal.accuracy.stages.solving import screen_conventions
from basecal.cli import main

answers_alone = without_stages(screen_conventions, find_error_at_task)


@pytest.fixture(scope="module")
def cell(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Cell with two runs, of which the second states the noise of its robots."""
    folder = tmp_path_factory.mktemp("compared") / "cell"
    assert main(["simulate", str(folder), "--samples", "15", "--seed", "5"]) == 0
    assert main(["calibrate", str(folder)]) == 0
    assert main(["calibrate", str(folder), "--robot-noise", "stated"]) in (0, 1)
    return folder


def test_runs_of_one_recording_agree(cell: Path, capsys: pytest.CaptureFixture[str]) -> None:
    first, second = sorted((cell / "runs").iterdir())
    assert main(["compare", str(first), str(second), "--json"]) == 0
    data = json.loads(capsys.readouterr().out)
    assert data["agree"] is True
    (difference,) = data["differences"]
    assert difference["settings"]["robot_noise"] == ["estimated", "stated"]
    assert difference["inputs"] == []
    assert "eye_base_from_hand_base" in difference["transforms"]


def test_cell_means_its_latest_run(cell: Path, capsys: pytest.CaptureFixture[str]) -> None:
    first, _ = sorted((cell / "runs").iterdir())
    assert main(["compare", str(first), str(cell)]) == 0
    assert capsys.readouterr().out.startswith("AGREE\n")


def test_single_run_is_refused(cell: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["compare", str(cell)]) == 2
    assert "give two or more runs" in capsys.readouterr().err


@pytest.mark.journey
def test_another_cell_disagrees(cell: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    other = tmp_path / "other"
    assert main(["simulate", str(other), "--samples", "15", "--seed", "6"]) == 0
    assert main(["calibrate", str(other), "--robot-noise", "stated"]) == 0
    capsys.readouterr()
    assert main(["compare", str(cell), str(other)]) == 1
    assert capsys.readouterr().out.startswith("DISAGREE\n")


def test_next_command_has_the_folder_of_the_cell(cell: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The folder is that of the last run, whether the cell or the run is named; all runs must agree."""
    first, second = sorted((cell / "runs").iterdir())
    for last in (second, cell):
        assert main(["compare", str(first), str(second), str(last)]) == 0
        out, err = capsys.readouterr()
        assert out.count("AGREE") == 1
        assert err == f"next: the figures of a run: basecal report {cell}\n"
