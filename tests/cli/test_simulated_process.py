"""`basecal simulate --process`: what draws its images."""

from __future__ import annotations

from pathlib import Path

import pytest

from basecal.cli import main
from basecal.cli.simulated_process import _draws_surroundings
from basecal.simulation.surroundings import graphics


def test_without_a_library_it_says_what_to_install(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The target is then drawn alone, and standard error has the line; nobody who asks for that is told anything."""
    monkeypatch.setattr(graphics, "missing_graphics", lambda: f"nothing to draw with: {graphics.APT_LINE}")
    assert not _draws_surroundings("auto")
    assert graphics.APT_LINE in capsys.readouterr().err
    assert not _draws_surroundings("analytic")
    assert capsys.readouterr().err == ""


def test_with_a_library_all_is_drawn(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """By itself, and without a word."""
    monkeypatch.setattr(graphics, "missing_graphics", lambda: None)
    assert _draws_surroundings("auto")
    assert capsys.readouterr().err == ""


def test_who_insists_is_refused(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    """A cell that must be drawn by MuJoCo does not run without it."""
    monkeypatch.setattr(graphics, "missing_graphics", lambda: "nothing to draw with")
    assert main(["simulate", str(tmp_path / "cell"), "--process", "--renderer", "mujoco", "--target", "led"]) == 3
    assert capsys.readouterr().err.strip() == "basecal: error: nothing to draw with"
