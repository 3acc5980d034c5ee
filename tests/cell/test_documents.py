"""Tests that the examples of docs/data_format.md are read verbatim."""

from __future__ import annotations

import json
import re
import runpy
from pathlib import Path

from basecal.cell.calibration import Calibration
from basecal.cell.files import calibration_to_dict, read_cell, read_recording

TEXT = (Path(__file__).parents[2] / "docs" / "data_format.md").read_text(encoding="utf-8")


def block(language: str, start: str) -> str:
    """Return the first example of this language whose text starts with `start`."""
    return next(text for text in re.findall(rf"```{language}\n(.*?)```", TEXT, re.S) if text.startswith(start))


def test_documented_cell_and_sample_are_read(folder: Path) -> None:
    """The documented sample belongs to the documented cell once the cell's omitted parts are filled in."""
    cell = block("yaml", "schema: basecal/cell/1")
    cell = cell.replace("  hand:      ", "  hand: {urdf: hand.urdf, base_link: base, flange_link: tool0}")
    cell = cell.replace("targets:\n", "  depth: {on: world}\ntargets:\n  tag: {on: hand}\n")
    (folder / "cell.yaml").write_text(cell)
    sample = json.loads(block("json", '{"sample"'))
    sample["robots"]["hand"]["joints_rad"] = [0, 1]
    (folder / "recording" / "samples.jsonl").write_text(json.dumps(sample))
    assert read_cell(folder).requested_transforms == ["eye_base_from_hand_base"]
    assert len(read_recording(folder).samples[0].observations) == 3


def test_documented_calibration_has_written_keys() -> None:
    """The documented result has the written keys in their order."""
    example = json.loads(block("json", '{"schema": "basecal/calibration/1"'))
    written = calibration_to_dict(Calibration("good"))
    assert list(example) == list(written)
    assert list(example["residuals"]) == list(written["residuals"])


def test_documented_table_of_kinds_is_current() -> None:
    """The table of target kinds is the one that docs/draw_targets.py writes."""
    script = runpy.run_path(str(Path(__file__).parents[2] / "docs" / "draw_targets.py"))
    assert script["table"]() in TEXT, "write the table and the figures anew: python docs/draw_targets.py"
    assert script["with_table"](TEXT) == TEXT
