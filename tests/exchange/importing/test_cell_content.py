"""What is in a folder already."""

from __future__ import annotations

from pathlib import Path

from basecal.cli import main
from basecal.exchange.importing.cell_content import known_cell, recorded_samples


def test_a_cell_that_may_be_there(tmp_path: Path) -> None:
    """None before it is made, and no samples before they are recorded."""
    assert known_cell(tmp_path / "c") is None
    main(["new", str(tmp_path / "c"), "--names", "left"])
    cell = known_cell(tmp_path / "c")
    assert cell is not None
    assert [*cell.robots] == ["left"]
    assert recorded_samples(tmp_path / "c", cell) == ()
    (tmp_path / "c" / "recording" / "samples.jsonl").unlink()
    assert recorded_samples(tmp_path / "c", cell) == ()


def test_samples_that_are_recorded(tmp_path: Path) -> None:
    """All of them."""
    main(["simulate", str(tmp_path / "c"), "--samples", "3"])
    cell = known_cell(tmp_path / "c")
    assert cell is not None
    assert [sample.sample for sample in recorded_samples(tmp_path / "c", cell)] == [0, 1, 2]
