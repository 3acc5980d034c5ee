"""What an import says of conventions."""

from __future__ import annotations

from pathlib import Path

import pytest
from tests.journeys.raw import cell
from tests.shared.rewriting import inverted, with_robots

from basecal.cell import Cell, Recording
from basecal.cli.convention_check import say_conventions
from basecal.simulation import Scenario, simulate
from basecal.simulation.images import render_recording

MADE = simulate(Scenario(samples=12, target="pose"), 4)


def said(
    recording: Recording, capsys: pytest.CaptureFixture[str], of: Cell = MADE.cell, folder: Path = Path()
) -> tuple[bool, str, str]:
    is_wrong = bool(say_conventions(folder, of, recording))
    streams = capsys.readouterr()
    return is_wrong, streams.out, streams.err


def test_it_says_that_they_hold(capsys: pytest.CaptureFixture[str]) -> None:
    """One line with the error by which."""
    is_wrong, out, err = said(MADE.recording, capsys)
    assert (is_wrong, err) == (False, "")
    assert out.startswith("conventions hold: each of 12 views is predicted by the others to ")
    assert out.count("\n") == 1


def test_it_says_what_does_not(capsys: pytest.CaptureFixture[str]) -> None:
    """The finding stands in a warning, with the fix."""
    is_wrong, out, err = said(with_robots(MADE.recording, {"hand": inverted}), capsys)
    assert (is_wrong, out) == (True, "")
    assert "warning: robot-pose-inverted, by 12 views: The poses of hand are inverted" in err
    assert "or invert the poses. Or let `basecal fix .` do so." in err


def test_it_says_that_nothing_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    """Of too few views."""
    is_wrong, out, _ = said(Recording(MADE.recording.samples[:3]), capsys)
    expected = "conventions are not determined by 3 views: 5 with the robots' poses are needed\n"
    assert (is_wrong, out) == (False, expected)


def test_images_are_searched_and_kept(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """What is found in images serves the calibration that follows."""
    made = cell(samples=6, seed=3)
    recording = render_recording(made, tmp_path)
    is_wrong, out, _ = said(recording, capsys, made.cell, tmp_path)
    assert not is_wrong
    assert out.startswith("conventions hold: each of 6 views")
    assert list((tmp_path / "derived").rglob("*"))
