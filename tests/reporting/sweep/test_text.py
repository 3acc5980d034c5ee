"""A study as text."""

from __future__ import annotations

from basecal.reporting.sweep.text import sweep_text
from sweep_example import summary


def test_every_point_has_its_row() -> None:
    """With the axes' values first; what was not computed is left out, and reasons are said once."""
    lines = sweep_text(summary()).splitlines()
    assert lines[0] == "Some study"
    assert lines[1].split()[:2] == ["board", "samples"]
    assert len(lines) == 2 + 6 + 1
    assert "9/10" in lines[2]
    assert "6.10 for 6" in lines[2]
    assert lines[-1] == "no answer: not converged"
    assert "0/10" in lines[7]
