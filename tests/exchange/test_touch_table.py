"""What a table says was touched."""

from __future__ import annotations

from pathlib import Path

import pytest

from basecal.errors import DatasetError
from basecal.exchange.importing.imported import Row
from basecal.exchange.touch_table import TouchTable, as_name, new_rows, touch_names


@pytest.mark.parametrize(("text", "name"), [("A", "a"), (" Mark 1 ", "mark_1"), ("1", "mark_1"), ('"P-2"', "p_2")])
def test_names_are_made_fit(text, name):
    """Small letters, digits and _, a letter first."""
    assert as_name(text) == name


def test_rows_of_a_robot(tmp_path):
    """Those of others are left out; a robot without any is an error that names those there are."""
    (tmp_path / "a.csv").write_text("robot,point,x\nleft,A,1\nright,B,2\nleft,C,3\n")
    table, rows = TouchTable(str(tmp_path / "a.csv"), ("x",)), [Row(sample=k) for k in range(3)]
    kept, marks = touch_names(table, rows, "left", None)
    assert ([row.sample for row in kept], marks) == ([0, 2], ["a", "c"])
    with pytest.raises(DatasetError, match="there are: left, right"):
        touch_names(table, rows, "third", None)


def test_a_row_without_its_mark_is_an_error_with_its_line(tmp_path):
    """So is one whose last cells are left out."""
    (tmp_path / "a.csv").write_text("x,mark\n1,A\n2\n")
    table = TouchTable(str(tmp_path / "a.csv"), ("x",))
    with pytest.raises(DatasetError, match=r":3: mark: is empty in this row"):
        touch_names(table, [Row(), Row()], "left", None)


def test_new_rows_count_on(tmp_path: Path):
    """From the first number that is free; numbers that rows have stay."""
    assert [row.sample for row in new_rows(tmp_path, None, [Row(), Row(sample=7), Row()])] == [0, 7, 2]
