"""The README: its code runs."""

from __future__ import annotations

import re
from pathlib import Path
from shutil import copytree

import pytest

from basecal.cli import main

ROOT = Path(__file__).parents[1]


TEXT = (ROOT / "README.md").read_text(encoding="utf-8")


def test_library_example_runs(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """The Python example runs as it stands, and prints a good answer and its report."""
    (code,) = re.findall(r"```python\n(.*?)```", TEXT, re.DOTALL)
    monkeypatch.chdir(ROOT)
    exec(code, {})
    printed = capsys.readouterr().out
    assert printed.startswith("good\n")
    assert "GOOD: eye_base_from_hand_base to " in printed


def test_report_is_that_of_the_example(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The report that is shown is what the command beside it prints."""
    copytree(ROOT / "examples" / "ur5e_dual", tmp_path / "ur5e_dual")
    assert main(["calibrate", str(tmp_path / "ur5e_dual")]) == 0
    shown = re.search(r"```text\n(.*?)```", TEXT, re.DOTALL)
    assert shown is not None
    assert capsys.readouterr().out == shown[1]
