"""Subprocess that converts the first sheet of an Excel workbook to comma-separated text, by openpyxl."""

from __future__ import annotations

import csv
import warnings
from collections.abc import Generator, Iterator, Sequence
from contextlib import closing
from datetime import date, datetime, time, timedelta
from io import StringIO
from itertools import islice
from pathlib import Path
from typing import Any
from zipfile import ZipFile

from openpyxl import load_workbook

from basecal.box import Frame, is_own_fault
from basecal.errors import InputError
from basecal.fields.problems import shorten

_LARGEST_BYTES = 2**25  # size limit of an unpacked part: a hundred thousand poses
_MOST_TEXT = 2**26  # characters, as of a text file: a cell may repeat a long text of another one
_MOST_ROWS, _MOST_COLUMNS = 2**20, 256  # limit of Excel; more columns than a sample has
_ROWS_AT_ONCE = 256  # in one frame
_DAY_ZERO = datetime(1899, 12, 30)  # day of a time without a date


def read_frames(words: Sequence[str]) -> Iterator[Frame]:
    """Frames with the text of some rows of the workbook that `words` names, one line per row."""
    count = 0
    try:
        for text in _texts(Path(words[0])):
            count += len(text)
            if count > _MOST_TEXT:
                raise InputError(f"has more than {_MOST_TEXT >> 20} MB of text in its first sheet")
            yield None, text.encode()
    except (MemoryError, InputError):
        raise
    except Exception as error:  # openpyxl passes on whatever a damaged part causes
        if is_own_fault(error):
            raise
        raise InputError("is a damaged Excel workbook") from None


def _texts(path: Path) -> Iterator[str]:
    """Comma-separated text of some rows at a time."""
    with closing(_rows(path)) as rows:
        while some := list(islice(rows, _ROWS_AT_ONCE)):
            text = StringIO()
            csv.writer(text, lineterminator="\n").writerows(some)
            yield text.getvalue()


def _rows(path: Path) -> Generator[list[str], None, None]:
    """Cells of all rows from the first row and column on, each row without its last empty cells."""
    _check_sizes(path)
    with (
        path.open("rb") as file,  # by its name, openpyxl refuses other suffixes
        warnings.catch_warnings(action="ignore"),  # about styles, validation and charts
        closing(load_workbook(file, read_only=True, data_only=True, keep_links=False)) as book,
    ):
        sheets = [each for each in book.worksheets if each.sheet_state == "visible"]
        if not sheets:
            raise InputError("holds no sheet of an Excel workbook")
        sheets[0].reset_dimensions()  # some programs write wrong ones
        for row in islice(sheets[0].iter_rows(values_only=True), _MOST_ROWS):
            cells = [_text(value) for value in row[:_MOST_COLUMNS]]
            yield cells[: max((k for k, cell in enumerate(cells, start=1) if cell), default=0)]


def _check_sizes(path: Path) -> None:
    """Raise InputError for a part that unpacks to too many bytes; no more than its stated size is unpacked."""
    with ZipFile(path) as archive:
        for part in archive.infolist():
            if part.file_size > _LARGEST_BYTES:
                raise InputError(
                    f"has a part {shorten(part.filename)} that unpacks to more than {_LARGEST_BYTES >> 20} MB"
                )


def _text(value: Any) -> str:
    """Text of a cell on one line; empty for an empty cell."""
    if isinstance(value, timedelta):
        value = _DAY_ZERO + value
    elif isinstance(value, time):
        value = datetime.combine(_DAY_ZERO, value)
    if isinstance(value, date):
        return value.isoformat()
    return "" if value is None else " ".join(str(value).split())
