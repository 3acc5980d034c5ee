"""Reading of CSV tables with a header."""

from __future__ import annotations

import codecs
import csv
import re
from array import array
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from io import StringIO
from pathlib import Path

import numpy as np

from basecal.bounded_file import read_bounded
from basecal.errors import DatasetError, count_text, list_names
from basecal.exchange.fields import parse_float
from basecal.exchange.workbook import workbook_text
from basecal.fields.problems import shorten
from basecal.geometry import Array


@dataclass(frozen=True, eq=False)
class Table:
    """Columns of numbers by name, and the line number of each row in the file."""

    values: Mapping[str, Array]
    lines: Sequence[int]

    def stack(self, names: Sequence[str]) -> Array:
        """Stack columns to an array, (rows, len(names))."""
        return np.stack([self.values[name] for name in names], -1)


LARGEST_BYTES = 2**26
"""Largest text file [bytes]: 64 MB, two million points."""

_LARGEST = 1e12  # limit of any number: times in seconds since 1970 are about 2e9
_UTF_16 = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
_BINARY = re.compile(r"[\x00-\x08\x0e-\x19]")  # control characters that do not occur in text
_MINUS = "\u2212"  # minus sign of word processors
_ARCHIVE, _OLD_SHEET = b"PK\x03\x04", b"\xd0\xcf\x11\xe0"  # first bytes of .xlsx and .ods, and of .xls


def read_table_text(path: str, content: str) -> str:
    """Read the text of a file in UTF-8, UTF-16 or cp1252, or the first sheet of an Excel workbook, with line feeds.

    Raises:
        DatasetError: if the file cannot be read, is too large or is not text; the message names the expected `content`.
    """
    data = read_bounded(path, LARGEST_BYTES)
    if data.startswith(_ARCHIVE):
        return workbook_text(path, len(data))
    if data.startswith(_OLD_SHEET):
        raise DatasetError(path, "is a file of a spreadsheet program: save it as CSV, and import that")
    try:
        text = data.decode("utf-16") if data.startswith(_UTF_16) else _eight_bit_text(data)
    except UnicodeDecodeError:
        raise DatasetError(path, f"not text, expected {content}") from None
    if _BINARY.search(text):
        raise DatasetError(path, f"not text, expected {content}")
    return text.replace(_MINUS, "-").replace("\r\n", "\n").replace("\r", "\n")


def _eight_bit_text(data: bytes) -> str:
    """Decode UTF-8, or else cp1252, the Windows code page of Western Europe."""
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("cp1252")


def read_columns(path: str | Path, aliases: Mapping[str, Sequence[str]]) -> Table:
    """Read a table of finite numbers.

    Args:
        path: Comma-separated text; the first line is the header and may start with `#`.
        aliases: Alternative names of columns by the name in the result; case is ignored.

    Raises:
        DatasetError: with file and line, if a cell is not a finite number or the length of a row differs.
    """
    name = str(path)
    rows = _rows(name, read_table_text(name, "comma-separated values"))
    line, first = next(rows, (0, []))
    if not first:
        raise DatasetError(name, "is empty, expected a header that names the columns")
    known = {alias: name for name, others in aliases.items() for alias in (name, *others)}
    plain = [cell.lstrip("#").strip().lower() for cell in first]
    header = [known.get(cell, cell) for cell in plain]
    if len(set(header)) != len(header):
        raise DatasetError(name, f"names a column twice: {list_names(header)}", line)
    # Arrays of bytes, because lists of lists need forty times the memory.
    values, lines = array("d"), array("q")
    for line, row in rows:
        values.extend(_numbers(name, line, row, header))
        lines.append(line)
    if not lines:
        raise DatasetError(name, "has a header and no rows")
    columns = np.array(values).reshape(-1, len(header)).T
    return Table(dict(zip(header, columns, strict=True)), lines)


def _rows(path: str, text: str) -> Iterator[tuple[int, list[str]]]:
    """Line number and cells of each non-empty row.

    Raises:
        DatasetError: if the text is not CSV.
    """
    reader = csv.reader(StringIO(text, newline=""), skipinitialspace=True)
    try:
        for row in reader:
            if any(cell.strip() for cell in row):
                yield reader.line_num, row
    except csv.Error as error:
        raise DatasetError(path, f"not comma-separated values: {error}", reader.line_num) from None


def _numbers(path: str, line: int, row: Sequence[str], header: Sequence[str]) -> list[float]:
    if len(row) != len(header):
        raise DatasetError(path, f"{count_text(len(row), 'column')}, the header has {len(header)}", line)
    numbers = []
    for cell, name in zip(row, header, strict=True):
        try:
            numbers.append(parse_float(cell))
        except ValueError:
            raise DatasetError(path, f"{shorten(cell)} is not a number", line, name) from None
        if not abs(numbers[-1]) <= _LARGEST:
            raise DatasetError(path, f"{shorten(cell)} is not finite, or beyond {_LARGEST:g}", line, name)
    return numbers
