"""Tests of workbooks in the sandbox: a small file that unpacks to cells without end is refused on one line."""

from __future__ import annotations

from pathlib import Path

import pytest

from basecal import box
from basecal.errors import DatasetError
from basecal.exchange.columns import read_table_text
from exchange.test_workbook_boxed import SHEET, replace_part, workbook


def test_workbook_becomes_text_of_table(tmp_path: Path) -> None:
    """The first sheet is read in a process of its own, whatever the name of the file ends in."""
    path = tmp_path / "poses.txt"
    path.write_bytes(workbook(("a, b", "c"), (1.5, None), ("ä", 2)))
    assert read_table_text(str(path), "a table") == '"a, b",c\n1.5\nä,2\n'


def test_cells_without_end_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Time is limited where a small file has rows of many columns, and the line states what to do."""
    monkeypatch.setattr(box, "_LEAST_LIMIT_S", 2)
    cells = '<row><c r="XFD1"><v>1</v></c></row>' * 300_000
    path = tmp_path / "w.xlsx"
    path.write_bytes(
        replace_part(workbook((1.0,)), SHEET, lambda part: part.replace("</sheetData>", f"{cells}</sheetData>"))
    )
    assert path.stat().st_size < 100_000
    with pytest.raises(DatasetError, match=r"w\.xlsx: takes more than 2 s to read.*: save it as CSV, and import that$"):
        read_table_text(str(path), "a table")
