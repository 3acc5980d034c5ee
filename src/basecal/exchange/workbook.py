"""Conversion of the first sheet of an Excel workbook (.xlsx) to comma-separated text, by openpyxl."""

from __future__ import annotations

import csv
import warnings
from collections.abc import Iterator
from contextlib import closing
from datetime import date, datetime, time, timedelta
from io import BytesIO, StringIO
from itertools import islice
from typing import Any
from zipfile import ZipFile

from basecal.errors import DatasetError

_LARGEST_BYTES = 2**25  # size limit of an unpacked part: a hundred thousand poses
_MOST_ROWS, _MOST_COLUMNS = 2**20, 256  # limit of Excel; more columns than a sample has
_DAY_ZERO = datetime(1899, 12, 30)  # day of a time without a date


def workbook_text(data: bytes, path: str) -> str:
    """Convert the first visible sheet to text, one line per row; cells of formulas have their last value.

    Args:
        data: Content of the file.
        path: Name of the file in errors.

    Raises:
        DatasetError: if the data are not a workbook, or a part is too large.
    """
    try:
        rows = list(_rows(data, path))
    except DatasetError:
        raise
    except Exception:  # openpyxl passes on whatever a damaged part causes
        raise DatasetError(path, "is a damaged Excel workbook: save it as CSV, and import that") from None
    text = StringIO()
    csv.writer(text, lineterminator="\n").writerows(rows)
    return text.getvalue()


def _rows(data: bytes, path: str) -> Iterator[list[str]]:
    """Cells of all rows from the first row and column on, each row without its last empty cells."""
    from openpyxl import load_workbook

    _check_sizes(data, path)
    with (
        warnings.catch_warnings(action="ignore"),  # about styles, validation and charts
        closing(load_workbook(BytesIO(data), read_only=True, data_only=True, keep_links=False)) as book,
    ):
        sheets = [each for each in book.worksheets if each.sheet_state == "visible"]
        if not sheets:
            raise DatasetError(path, "holds no sheet of an Excel workbook: save it as CSV, and import that")
        sheets[0].reset_dimensions()  # some programs write wrong ones
        for row in islice(sheets[0].iter_rows(values_only=True), _MOST_ROWS):
            cells = [_text(value) for value in row[:_MOST_COLUMNS]]
            yield cells[: max((k for k, cell in enumerate(cells, start=1) if cell), default=0)]


def _check_sizes(data: bytes, path: str) -> None:
    """Raise DatasetError for a part that unpacks to too many bytes; no more than its stated size is unpacked."""
    with ZipFile(BytesIO(data)) as archive:
        for part in archive.infolist():
            if part.filename.endswith((".xml", ".rels")) and part.file_size > _LARGEST_BYTES:
                limit = f"{_LARGEST_BYTES >> 20} MB"
                raise DatasetError(path, f"{part.filename} unpacks to more than {limit}: save the sheet as CSV")


def _text(value: Any) -> str:
    """Text of a cell on one line; empty for an empty cell."""
    if isinstance(value, timedelta):
        value = _DAY_ZERO + value
    elif isinstance(value, time):
        value = datetime.combine(_DAY_ZERO, value)
    if isinstance(value, date):
        return value.isoformat()
    return "" if value is None else " ".join(str(value).split())
