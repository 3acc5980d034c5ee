"""What is in a folder already."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from basecal.cli import main
from basecal.exchange.importing.cell_content import NO_CELL, known_cell, open_size, recorded_samples


def test_a_cell_that_may_be_there(tmp_path: Path) -> None:
    """None before it is made, and no samples before they are recorded."""
    assert known_cell(tmp_path / "c") is NO_CELL
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


@pytest.mark.parametrize(
    ("seen", "is_open"),
    [
        ({}, True),
        ({"images": {"camera": "a.png"}}, False),
        ({"observations": [{"camera": "camera", "target": "target", "ids": [0], "pixels": [[1, 2]]}]}, False),
    ],
)
def test_a_size_is_open_until_something_was_seen(tmp_path: Path, seen: dict[str, object], is_open: bool) -> None:
    """An image and an observation of the camera both rest on it."""
    main(["new", str(tmp_path), "--names", "left"])
    cell = known_cell(tmp_path)
    assert cell is not None
    (tmp_path / "recording" / "samples.jsonl").write_text(json.dumps({"sample": 0, **seen}) + "\n", encoding="utf-8")
    (name,) = cell.cameras
    found = open_size(tmp_path, cell, name)
    assert found == (frozenset({("cameras", name, "size_px")}) if is_open else frozenset())
