"""Journeys of newcomers: at most five commands, and the answer is within its 99 % ellipsoid."""

from __future__ import annotations

import shlex
from collections.abc import Callable
from pathlib import Path

import pytest
from scipy.stats import chi2

from basecal.cell.files import read_recording
from basecal.cli import main
from tests.journeys.personas import Persona, opencv_arm, opencv_cameras, production, ros_sessions, three_makers
from tests.journeys.raw import run, squared_error

HOLD = 0.99


@pytest.mark.slow
@pytest.mark.parametrize(
    ("persona", "seed"),
    [
        (opencv_arm, 0),
        (opencv_cameras, 0),
        (opencv_cameras, 9),  # two draws with a frontal view that an arm's noise beside a wrong shape made an outlier
        (opencv_cameras, 11),
        (ros_sessions, 0),
        (three_makers, 0),
        (production, 0),
    ],
)
def test_from_files_to_an_answer(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, persona: Callable[[Path, int], Persona], seed: int
) -> None:
    """Each command succeeds, including the calibration, and the answer is true."""
    monkeypatch.chdir(tmp_path)
    made = persona(tmp_path, seed)
    run(*made.commands)
    for name, truth in made.truth.items():
        assert squared_error(tmp_path / made.cell, name, truth) < chi2.ppf(HOLD, 6), name


def test_commands_of_sessions_are_documented(tmp_path: Path) -> None:
    """The page of imports has these commands in order."""
    page = (Path(__file__).parents[2] / "docs" / "importing.md").read_text()
    assert "\n".join(ros_sessions(tmp_path, 0).commands) in page


def test_sessions_of_unequal_length(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A second session of another length joins the first; missing data are named with their command."""
    monkeypatch.chdir(tmp_path)
    first, _, second, *_ = ros_sessions(tmp_path, 0).commands
    assert main(shlex.split(first)[1:]) == 0
    assert main(shlex.split(second)[1:]) == 0
    told = capsys.readouterr().out
    assert "completed the 38 samples, 21 of them new, of mycell: next, the states of right in samples 0 to 16: " in told
    assert told.rstrip().endswith("basecal import poses mycell --robot right FILE --format FORMAT --still")
    samples = read_recording(tmp_path / "mycell").samples
    assert [sorted(sample.robots) for sample in samples] == [["left"]] * 17 + [["right"]] * 21
