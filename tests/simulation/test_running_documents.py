"""Tests of the documentation of capture against the code."""

from __future__ import annotations

import re
from pathlib import Path

from basecal.simulation.running.faults import FAULTS
from basecal.simulation.running.server import REQUESTS

PAGE = (Path(__file__).parents[2] / "docs" / "capture.md").read_text(encoding="utf-8")


def rows(heading: str) -> list[list[str]]:
    """Cells of the table under a heading, without its head."""
    part = PAGE.split(f"\n## {heading}\n")[1].split("\n## ")[0]
    lines = [line for line in part.splitlines() if line.startswith("|")][2:]
    return [[cell.strip().strip("`") for cell in line.strip("|").split("|")] for line in lines]


def test_every_fault_is_documented():
    """The page has the name, unit, default size and description of each fault, with the words of the code."""
    described = rows("A simulated cell that runs")
    stated = [[name, kind.unit, str(kind.default_size), kind.description] for name, kind in FAULTS.items()]
    wrong = ["| `{}` | {} |".format(row[0], " | ".join(row[1:])) for row in stated if row not in described]
    assert not wrong, f"docs/capture.md: the table of faults lacks {', '.join(wrong)}"
    assert described == stated, f"docs/capture.md: one row for each fault, in this order: {', '.join(FAULTS)}"


def test_every_request_is_documented():
    """The page lists all requests that a running cell answers, and no others."""
    assert [row[0] for row in rows("What a running cell answers")] == list(REQUESTS)
    assert not re.search(r"TODO|TBD", PAGE)
