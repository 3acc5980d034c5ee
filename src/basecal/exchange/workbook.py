"""Conversion of the first sheet of an Excel workbook (.xlsx) to comma-separated text.

Source: ECMA-376, part 1, SpreadsheetML: `sheets`, `sheetData`, `row`, `c`, `v`, `is` and `sst`.
"""

from __future__ import annotations

import csv
import re
import zlib
from collections.abc import Iterator
from datetime import datetime, timedelta
from io import BytesIO, StringIO
from posixpath import join, normpath
from typing import Any
from zipfile import BadZipFile, ZipFile

from basecal.errors import DatasetError

_SHEET = re.compile(r"xl/worksheets/sheet(\d+)\.xml")
_STRINGS, _STYLES = "xl/sharedStrings.xml", "xl/styles.xml"
_BOOK, _PARTS_OF_BOOK = "xl/workbook.xml", "xl/_rels/workbook.xml.rels"
_DATE_FORMATS = frozenset(map(str, (*range(14, 23), *range(45, 48))))  # numbers of built-in formats of dates and times
_LITERALS = re.compile(r'"[^"]*"|\[[^\]]*\]|\\.')  # text, colours and conditions in the code of a format
_DATE_CODE = re.compile(r"[ymdhs]", re.IGNORECASE)
_DAY_ZERO = datetime(1899, 12, 30)  # of Excel's count of days, for dates since March 1900
_REFERENCE = re.compile(r"([A-Z]{1,3})\d+")
_LARGEST_BYTES = 2**25  # size limit of an unpacked part: a hundred thousand poses
_MOST_COLUMNS = 256
_MOST_ROWS = 2**20  # limit of Excel


def workbook_text(data: bytes, path: str) -> str:
    """Convert the first sheet to text, one line per row.

    Args:
        data: Content of the file.
        path: Name of the file in errors.

    Raises:
        DatasetError: if the data are not a workbook, or a part is too large.
    """
    from defusedxml.common import DefusedXmlException

    try:
        with ZipFile(BytesIO(data)) as archive:
            name = _first_sheet(archive, path)
            if not name:
                raise DatasetError(path, "holds no sheet of an Excel workbook: save it as CSV, and import that")
            strings = [_text(each) for each in _part(archive, _STRINGS, path)] if _STRINGS in archive.namelist() else []
            sheet = _part(archive, name, path)
            rows = list(_rows(sheet, strings, _date_styles(archive, path)))
    except (
        BadZipFile,
        SyntaxError,
        DefusedXmlException,
        LookupError,
        ValueError,
        OverflowError,
        zlib.error,
        RuntimeError,
    ) as error:
        if isinstance(error, DatasetError):
            raise
        raise DatasetError(path, "is a damaged Excel workbook: save it as CSV, and import that") from None
    text = StringIO()
    csv.writer(text, lineterminator="\n").writerows(rows)
    return text.getvalue()


def _first_sheet(archive: ZipFile, path: str) -> str:
    """Name of the part of the first visible sheet, else of the sheet with the lowest number; empty if there is none."""
    names = archive.namelist()
    if {_BOOK, _PARTS_OF_BOOK} <= {*names}:
        targets = {each.get("Id"): each.get("Target", "") for each in _part(archive, _PARTS_OF_BOOK, path)}
        sheets = [each for each in _part(archive, _BOOK, path).iter() if _tag(each) == "sheet"]
        for sheet in (each for each in sheets if each.get("state", "visible") == "visible"):
            place = next((value for key, value in sheet.items() if key.endswith("}id")), "")
            name = normpath(join("/xl", targets.get(place, ""))).lstrip("/")
            if name in names:
                return name
    numbers = {int(found[1]): found[0] for name in names if (found := _SHEET.fullmatch(name))}
    return numbers[min(numbers)] if numbers else ""


def _part(archive: ZipFile, name: str, path: str) -> Any:
    """Parse the XML of a part."""
    from defusedxml.ElementTree import fromstring

    with archive.open(name) as part:
        data = part.read(_LARGEST_BYTES + 1)
    if len(data) > _LARGEST_BYTES:
        raise DatasetError(path, f"{name} unpacks to more than {_LARGEST_BYTES >> 20} MB: save the sheet as CSV")
    return fromstring(data)


def _date_styles(archive: ZipFile, path: str) -> frozenset[str]:
    """Numbers of the cell styles that show a number as a date or a time."""
    if _STYLES not in archive.namelist():
        return frozenset()
    styles = _part(archive, _STYLES, path)
    codes = {each.get("numFmtId"): each.get("formatCode", "") for each in styles.iter() if _tag(each) == "numFmt"}
    custom = {number for number, code in codes.items() if _DATE_CODE.search(_LITERALS.sub("", code))}
    cell_styles = next((each for each in styles if _tag(each) == "cellXfs"), ())
    dates = _DATE_FORMATS | custom
    return frozenset(str(index) for index, each in enumerate(cell_styles) if each.get("numFmtId") in dates)


def _rows(sheet: Any, strings: list[str], date_styles: frozenset[str]) -> Iterator[list[str]]:
    """Cells of all rows from the first row and column on; rows and cells missing in the workbook are empty."""
    count = 0
    for row in (each for each in sheet.iter() if _tag(each) == "row"):
        number = min(int(row.get("r", count + 1)), _MOST_ROWS)
        yield from ([] for _ in range(count + 1, number))
        count = max(number, count + 1)
        found = dict(_text_cells(row, strings, date_styles))
        yield [found.get(column, "") for column in range(max(found, default=-1) + 1)]


def _text_cells(row: Any, strings: list[str], date_styles: frozenset[str]) -> Iterator[tuple[int, str]]:
    """Column and text of each non-empty cell."""
    for count, cell in enumerate(each for each in row if _tag(each) == "c"):
        reference = _REFERENCE.fullmatch(cell.get("r", ""))
        column = count if reference is None else _column(reference[1])
        value = next((each.text or "" for each in cell if _tag(each) == "v"), "")
        if value and cell.get("s") in date_styles and cell.get("t", "n") == "n":
            value = (_DAY_ZERO + timedelta(days=float(value))).isoformat()
        text = strings[int(value)] if cell.get("t") == "s" else _text(cell) if cell.get("t") == "inlineStr" else value
        if text and column < _MOST_COLUMNS:
            yield column, " ".join(text.split())


def _column(letters: str) -> int:
    number = 0
    for letter in letters:
        number = 26 * number + ord(letter) - ord("A") + 1
    return number - 1


def _text(element: Any) -> str:
    return "".join(each.text or "" for each in element.iter() if _tag(each) == "t")


def _tag(element: Any) -> str:
    return str(element.tag).rpartition("}")[2]
