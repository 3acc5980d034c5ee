"""Tests of tables of numbers whose columns are found by their header."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from basecal.errors import DatasetError
from basecal.exchange.columns import read_columns, read_table_text

ALIASES = {"x": ("tx", "pos_x"), "time": ("stamp",)}


def write_table(folder: Path, text: str) -> Path:
    path = folder / "table.csv"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize("header", ["x,time,y", "# TX , stamp,Y", "\ufeffpos_x,STAMP, y"])
def test_columns_are_found_by_header_names(tmp_path, header):
    """Columns are found by any alias and case, with a leading # or byte-order mark; each row knows its line."""
    table = read_columns(write_table(tmp_path, f"{header}\n1,2,3\n\n 4, 5.5 ,-6e1\n"), ALIASES)
    assert {name: values.tolist() for name, values in table.values.items()} == {
        "x": [1.0, 4.0],
        "time": [2.0, 5.5],
        "y": [3.0, -60.0],
    }
    assert list(table.lines) == [2, 4]
    np.testing.assert_array_equal(table.stack(["y", "x"]), [[3, 1], [-60, 4]])


@pytest.mark.parametrize(
    ("text", "line", "message"),
    [
        ("", None, "is empty"),
        ("x,y\n", None, "has a header and no rows"),
        ("x,tx\n1,2\n", 1, "names a column twice: x, x"),
        ("x,y\n1,2\n3\n", 3, "1 column, the header has 2"),
        ("x,y\n1,two\n", 2, "'two' is not a number"),
        ("x,y\n1,inf\n", 2, "'inf' is not finite"),
        ("x,y\n1,1e200\n", 2, "'1e200' is not finite, or beyond 1e\\+12"),
        pytest.param(f"x,y\n1,{'9' * 131_073}\n", 2, "field larger than field limit", id="field"),
    ],
)
def test_invalid_table_error_has_line(tmp_path, text, line, message):
    """The error states the line and what was expected there."""
    with pytest.raises(DatasetError, match=message) as caught:
        read_columns(write_table(tmp_path, text), ALIASES)
    assert caught.value.line == line


def test_non_text_files_are_refused(tmp_path):
    """Binary data and a missing file are refused."""
    path = tmp_path / "table.csv"
    for data in (b"x,y\n\xff\x00,1\n", b"x,y\n\x81,1\n", b"\xff\xfex\x00y"):
        path.write_bytes(data)
        with pytest.raises(DatasetError, match="not text"):
            read_columns(path, ALIASES)
    with pytest.raises(DatasetError, match="cannot be read"):
        read_columns(tmp_path / "none.csv", ALIASES)


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "cp1252"])
def test_windows_encodings_are_read(tmp_path, encoding):
    """Degree signs and umlauts are read as spreadsheet programs and controllers save them."""
    path = tmp_path / "table.csv"
    path.write_bytes("x,A [°],Gerät\r\n1,2,3\r\n".encode(encoding))
    assert list(read_columns(path, ALIASES).values) == ["x", "a [°]", "gerät"]


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_all_line_endings_are_read(tmp_path, end):
    """Line feeds, CR LF and a carriage return alone are read.

    Excel's CSV for Macintosh uses the latter, and was read as one line.
    """
    path = tmp_path / "a.csv"
    path.write_bytes(end.join(["x,y", "1,2", "3,4", ""]).encode())
    assert read_table_text(str(path), "a table") == "x,y\n1,2\n3,4\n"


@pytest.mark.parametrize("sign", ["", "-", "\u2212"])
def test_numbers_up_to_1e12_with_any_minus_sign(tmp_path, sign):
    """Numbers of either sign are read, also with the minus sign of word processors."""
    assert read_columns(write_table(tmp_path, f"x\n{sign}1e12\n"), ALIASES).values["x"].tolist() == [
        -1e12 if sign else 1e12
    ]
    with pytest.raises(DatasetError, match=r"x: '-?1\.1e12' is not finite, or beyond"):
        read_columns(write_table(tmp_path, f"x\n{sign}1.1e12\n"), ALIASES)


@pytest.mark.parametrize(
    ("byte", "is_text"), [(0x08, False), (0x09, True), (0x0E, False), (0x19, False), (0x1B, True), (0x0B, True)]
)
def test_control_characters_are_refused(tmp_path, byte, is_text):
    """Control characters are refused except tabs, line ends and those that terminals interpret."""
    path = tmp_path / "table.csv"
    path.write_bytes(b"x,a" + bytes([byte]) + b"b\n1,2\n")
    if is_text:
        assert len(read_table_text(str(path), "a table")) > 8
    else:
        with pytest.raises(DatasetError, match="not text, expected a table"):
            read_table_text(str(path), "a table")


def test_old_spreadsheet_file_is_refused(tmp_path):
    """An old spreadsheet file is recognised by its first bytes, whatever its name.

    The error advises to save it as CSV.
    """
    path = tmp_path / "table.csv"
    path.write_bytes(b"\xd0\xcf\x11\xe0" + bytes(9))
    with pytest.raises(DatasetError, match="is a file of a spreadsheet program: save it as CSV, and import that"):
        read_table_text(str(path), "a table")


def test_blank_rows_are_skipped(tmp_path):
    """Quoted cells may contain commas and line ends; the line of a row is that of its end."""
    table = read_columns(write_table(tmp_path, 'x,"a, b"\n1,2\n , \n3,"4"\n'), ALIASES)
    assert {name: values.tolist() for name, values in table.values.items()} == {"x": [1, 3], "a, b": [2, 4]}
    assert list(table.lines) == [2, 4]


def test_quotes_after_blank_are_recognised(tmp_path):
    """Cells of the header and of numbers may be quoted after a comma and a blank."""
    table = read_columns(write_table(tmp_path, 'x, "y"\n1, "2"\n'), ALIASES)
    assert {name: values.tolist() for name, values in table.values.items()} == {"x": [1.0], "y": [2.0]}


def test_numbers_beyond_1e12_are_refused(tmp_path):
    """The limit itself is read, for either sign."""
    assert read_columns(write_table(tmp_path, "x\n1e12\n-1e12\n"), ALIASES).values["x"].tolist() == [1e12, -1e12]
    for cell in ("1.01e12", "-1.01e12", "nan"):
        with pytest.raises(DatasetError, match="is not finite, or beyond"):
            read_columns(write_table(tmp_path, f"x\n{cell}\n"), ALIASES)
