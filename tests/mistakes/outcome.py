"""Output of a command about a cell, as a user reads it."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import pytest

from basecal.cell.files import latest_run
from basecal.cli import main
from mistakes.table import UNREADABLE, USAGE

_KIND = {2: USAGE, 3: UNREADABLE}


@dataclass(frozen=True)
class Outcome:
    """What came of a command.

    Attributes:
        exit_code: Of the command.
        code: Of the gravest finding; or that a file is unreadable, or the command line wrong.
        first: The first sentence: all that stands before the next line that is not set in.
        text: All that was printed.
        verdict: Of the calibration; empty where there is none.
        transforms: Names of those that are given.
    """

    exit_code: int
    code: str
    first: str
    text: str
    verdict: str = ""
    transforms: tuple[str, ...] = ()


def outcome(words: Sequence[str], folder: Path, capsys: pytest.CaptureFixture[str]) -> Outcome:
    """Run a command on a cell and return its outcome."""
    capsys.readouterr()
    exit_code = main(list(words))
    said = capsys.readouterr()
    text = said.out if exit_code in (0, 1, 4, 5) else said.err
    lines = text.splitlines()
    end = next((i for i, line in enumerate(lines[1:], start=1) if not line.startswith("  ")), len(lines))
    first = " ".join(" ".join(lines[:end]).split())
    run = latest_run(folder) if exit_code in (0, 1, 4, 5) else None
    if run is None:
        return Outcome(exit_code, _KIND.get(exit_code, ""), first, text)
    answer = json.loads((run / "calibration.json").read_text())
    code = first.rpartition("[")[2].rstrip("]") if first.endswith("]") else ""
    if answer["verdict"] == "good" and answer["findings"]:
        code = answer["findings"][0]["code"]
    return Outcome(exit_code, code, first, text, answer["verdict"], tuple(answer["transforms"]))
