"""What a table says was touched."""

from __future__ import annotations

from pathlib import Path

import pytest

from basecal.errors import DatasetError
from basecal.exchange.importing.cell_content import NO_CELL
from basecal.exchange.importing.imported import Row
from basecal.exchange.touch_table import new_rows, touch_names


def test_rows_of_a_robot(tmp_path):
    """Those of others are left out; a robot without any is an error that names those there are."""
    (tmp_path / "a.csv").write_text("robot,point,x\nleft,A,1\nright,B,2\nleft,C,3\n")
    path = str(tmp_path / "a.csv")
    assert touch_names(path, ("x",), "left", None) == ["a", "c"]
    with pytest.raises(DatasetError, match="there are: left, right"):
        touch_names(path, ("x",), "third", None)


def test_a_row_without_its_mark_is_an_error_with_its_line(tmp_path):
    """So is one whose last cells are left out."""
    (tmp_path / "a.csv").write_text("x,mark\n1,A\n2\n")
    with pytest.raises(DatasetError, match=r":3: mark: is empty in this row"):
        touch_names(str(tmp_path / "a.csv"), ("x",), "left", None)


def test_new_rows_count_on(tmp_path: Path):
    """From the first number that is free; numbers that rows have stay."""
    assert [row.sample for row in new_rows(tmp_path, NO_CELL, [Row(), Row(sample=7), Row()])] == [0, 7, 2]
