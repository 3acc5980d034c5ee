"""Parsing of text tables: usual separators, decimal commas, with or without a header, poses in brackets."""

from __future__ import annotations

import csv
import math
import re
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from functools import cached_property
from io import StringIO

from basecal.cell.journal.recording_file import MOST_SAMPLES
from basecal.errors import DatasetError, count_text, list_names
from basecal.exchange.fields import parse_float
from basecal.exchange.json_rows import json_records, json_rows
from basecal.fields.problems import shorten

_SEPARATORS = (";", "\t", ",", None)  # None: white space
_NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")
_DECIMAL_COMMA = re.compile(r"[-+]?\d+,\d+(?:[eE][-+]?\d+)?")
_WITH_UNIT = re.compile(rf"(?:{_NUMBER.pattern}|{_DECIMAL_COMMA.pattern}) *(?:mm|cm|m|inch|in|deg|rad|°)")
_THOUSANDS = re.compile(r"[-+]?\d{1,3}(?:[,.' ]\d{3})+[.,]\d+")
_PERHAPS_THOUSANDS = re.compile(r"[-+]?[1-9]\d{0,2},\d{3}")
_NAMED_NUMBER = re.compile(r"([A-Za-z]\w*)(?:\s*[:=]\s*|\s+)([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)")
_IMAGE = re.compile(r"\.(?:png|jpe?g|tiff?|bmp|webp|pgm|ppm)$", re.IGNORECASE)
_LISTED_NUMBER = re.compile(rf"(?<![\w.]){_NUMBER.pattern}")
# Lines of programs whose numbers look like a pose but define a tool, a work object or a load.
_SETTING = re.compile(r"^\$?(?:BASE|TOOL|LOAD)(?:_DATA)?\b.*=|:=\s*\[\s*(?:TRUE|FALSE)\b|^set_tcp\b", re.IGNORECASE)
_NAMED_FIELDS = re.compile(r"\{\s*[A-Za-z]\w*\s|[\[({]\s*[A-Za-z]\w*\s*[:=]")  # named numbers, such as those of axes
_URSCRIPT_POSE = re.compile(r"\bp\[")  # without the p it is a list of joints
# Lines that must hold a pose: they start with a bracket or have a keyword of URScript, RAPID or KRL.
_POSE_CLAIM = re.compile(r"^[\[({]|\bp\[|\brobtarget\b.*:=|\b(?:E6POS|POS|FRAME)\b.*=", re.IGNORECASE)
_BRACKETED = re.compile(r"\[[^\[\](){}]*\]|\{[^\[\](){}]*\}|\([^\[\](){}]*\)")  # without nested brackets
_UNIT_CELL = re.compile(r"(?:mm|m|inch|in|deg|rad|°|s|ms|us|µs|ns|)")
_SUMMARY = re.compile(
    r"(?:mittel(?:wert)?|average|mean|avg|sum|total|summe|min|max|std|stdev|median|standardabweichung)\W*",
    re.IGNORECASE,
)
_COMMENTS = ("#", "!", ";", "//")
_LARGEST = 1e12  # limit of any number: times in seconds since 1970 are about 2e9


@dataclass(frozen=True)
class TextRow:
    """A row: its line number in the file, and its cells by column name."""

    line: int
    cells: dict[str, str]


@dataclass(frozen=True)
class TextTable:
    """A table of unparsed cells.

    Attributes:
        path: Path of the file.
        header: Names of the columns; None if the file has no header.
        rows: Rows in the order of the file; a row may lack cells at its end.
    """

    path: str
    header: tuple[str, ...] | None
    rows: tuple[TextRow, ...]

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the columns, of the header or of rows without header."""
        return tuple(self.rows[0].cells) if self.header is None else self.header

    @cached_property
    def _duplicates(self) -> frozenset[str]:
        """Names of several columns."""
        return frozenset(name for name, count in Counter(self.columns).items() if count > 1)

    def cell(self, row: TextRow, column: str) -> str:
        """Return the text of a row's cell.

        Raises:
            DatasetError: if the row has no such column or two of them, or the cell is empty.
        """
        if column in self._duplicates:
            raise DatasetError(self.path, f"names the column {column!r} twice: keep one")
        text = row.cells.get(column, "")
        if not text and column not in self.columns:
            raise DatasetError(self.path, f"has no {column} but {list_names(self.columns)}", row.line)
        if not text.strip("\"' "):
            raise DatasetError(self.path, "is empty in this row", row.line, column)
        return text

    def names(self, *columns: str) -> list[str] | None:
        """Return the cells of the first existing column, converted by `as_name`; None if no column exists."""
        header = {column.strip().lower(): column for column in self.header or ()}
        found = next((header[name] for name in columns if name in header), None)
        return None if found is None else [as_name(self.cell(row, found)) for row in self.rows]


def read_text_table(text: str, path: str, names: Sequence[str]) -> TextTable:
    """Parse a text table.

    Args:
        text: Lines; empty lines and comments (`#`, `!`, `;` or `//`) are skipped, but a comment may be the header.
        path: Name of the table in errors.
        names: Column names if there is no header; poses in brackets hold their numbers in this order.

    Raises:
        DatasetError: if a row has the wrong number of cells, or there are too many rows.
    """
    if records := [TextRow(line, cells) for line, cells in json_records(text, path)]:
        return TextTable(path, tuple(dict.fromkeys(name for row in records for name in row.cells)), tuple(records))
    text = json_rows(text) or text
    lines = [(number, line.strip()) for number, line in enumerate(StringIO(text), start=1) if line.strip()]
    content = [(number, line) for number, line in lines if not line.startswith(_COMMENTS)]
    if poses := tuple(_bracket_rows(content, names, path)):
        return TextTable(path, None, poses)
    content = list(_omit_titles(content))
    separator, header = _heading(lines, content, names)
    if content and _header(content[0][1]):
        content = content[1:]
    if header is not None and content and (units := _units(content[0][1], separator, len(header))):
        content = content[1:]
        header = tuple(f"{name} [{unit}]" if unit else name for name, unit in zip(header, units, strict=True))
    if not content:
        raise DatasetError(path, f"holds no row of numbers, expected {', '.join(names)}")
    if len(content) > MOST_SAMPLES:
        raise DatasetError(path, f"{len(content)} rows, expected at most {MOST_SAMPLES}")
    rows = [TextRow(number, _cells(line, separator, header, names, path, number)) for number, line in content]
    _check_summaries(rows, path)
    return TextTable(path, header, tuple(rows))


def _omit_titles(content: Sequence[tuple[int, str]]) -> Sequence[tuple[int, str]]:
    """Remove title lines, which have one cell and precede the header."""
    while len(content) > 1 and (found := _header(content[1][1])) and found[0] is not None:
        if sum(map(bool, _split(content[0][1], found[0]))) != 1:
            break
        content = content[1:]
    return content


def _units(line: str, separator: str | None, count: int) -> list[str] | None:
    """Units of the columns in a line below the header; None if the line is not a row of units."""
    cells = [cell.strip("[]()") for cell in _split(line, separator)]
    if len(cells) > count or not any(cells) or not all(_UNIT_CELL.fullmatch(cell) for cell in cells):
        return None
    return cells + [""] * (count - len(cells))


def _check_summaries(rows: Sequence[TextRow], path: str) -> None:
    """Check that no row is a summary of the others, such as a mean."""
    for row in rows:
        if word := next((cell for cell in row.cells.values() if _SUMMARY.fullmatch(cell)), None):
            raise DatasetError(path, f"{shorten(word)} is not a measured row: remove the row", row.line)


def _heading(
    lines: Sequence[tuple[int, str]], content: Sequence[tuple[int, str]], names: Sequence[str]
) -> tuple[str | None, tuple[str, ...] | None]:
    """Separator and header: the first line if none of its cells is a number, or a comment with as many cells."""
    if not content:
        return None, None
    first = content[0][1]
    if found := _header(first):
        return found
    for _, line in lines:
        for found in (_named_header(line, names), _header(line)) if line.startswith(_COMMENTS) else ():
            if found and len(_split(first, found[0])) == len(found[1]):
                return found
    return _separator(first), None


def _named_header(line: str, names: Sequence[str]) -> tuple[str | None, tuple[str, ...]] | None:
    """Header in a comment of any mark, if several cells are expected names; None for remarks."""
    found = _header(line.lstrip("#!;/ "))
    words = {word.lower() for cell in (found[1] if found else ()) for word in (cell, re.split(r"[_\s\[(]", cell)[0])}
    return found if len(words & set(map(str.lower, names))) > 1 else None


def as_name(text: str) -> str:
    """Convert a text to a valid name: lower-case letters, digits and _, starting with a letter."""
    plain = re.sub(r"[^a-z0-9]+", "_", text.strip().strip("\"'").lower()).strip("_")
    return plain if plain[:1].isalpha() else f"mark_{plain}"


def select_robot(table: TextTable, robot: str) -> TextTable:
    """Select a robot's rows by a column `robot` or `arm`; a table of a single robot is returned unchanged.

    Raises:
        DatasetError: if the table has several robots, but not this one.
    """
    names = table.names("robot", "arm")
    if names is None or len(set(names)) == 1:
        return table
    rows = tuple(row for row, name in zip(table.rows, names, strict=True) if name == robot)
    if not rows:
        known = list_names(list(dict.fromkeys(names)))
        raise DatasetError(table.path, f"no row belongs to robot {robot!r}; there are: {known}")
    return replace(table, rows=rows)


def parse_number(cell: str, path: str, line: int, name: str, unit: float = 1.0) -> float:
    """Parse the number in a cell, with a decimal point or comma, and multiply it by its unit.

    Raises:
        DatasetError: if the text is not a number, or the number is not finite or too large.
    """
    text = cell.strip().strip("\"'").rstrip(",")
    try:
        value = parse_float(text.replace(",", ".") if _DECIMAL_COMMA.fullmatch(text) else text) * unit
    except ValueError:
        cause = ": remove the thousands separators" if _THOUSANDS.fullmatch(text) else ""
        cause = ": write its unit in the header" if _WITH_UNIT.fullmatch(text) else cause
        raise DatasetError(path, f"{shorten(text)} is not a number{cause}", line, name) from None
    if not abs(value) <= _LARGEST:
        do = ": check its unit" if math.isfinite(value) else ""
        raise DatasetError(path, f"{shorten(text)} is not finite, or beyond {_LARGEST:g}{do}", line, name)
    return value


def parse_time(cell: str, path: str, line: int, name: str, unit_s: float = 1.0) -> float:
    """Parse the time in a cell [s]: a number of `unit_s`, or an ISO 8601 date and time, in UTC if it has no zone.

    Raises:
        DatasetError: if the text is neither.
    """
    text = cell.strip().strip("\"'")
    if _is_number(text) or not any(map(str.isdigit, text)):
        return parse_number(cell, path, line, name, unit_s)
    try:
        moment = datetime.fromisoformat(text)
    except ValueError:
        do = "give seconds, or the form 2026-05-01T12:30:00.5"
        raise DatasetError(path, f"{shorten(text)} is not a number: {do}", line, name) from None
    return (moment if moment.tzinfo else moment.replace(tzinfo=UTC)).timestamp()


def is_image(name: str) -> bool:
    """Whether a file name has the extension of an image."""
    return bool(_IMAGE.search(name.strip()))


def count_numbers(text: str) -> int:
    """Count the numbers in a text; digits within names do not count."""
    return len(_LISTED_NUMBER.findall(text))


def _bracket_rows(content: Sequence[tuple[int, str]], names: Sequence[str], path: str) -> Iterator[TextRow]:
    """Rows of the lines with a pose in brackets; other lines of a controller's program are skipped.

    Raises:
        DatasetError: if the brackets of a pose lack a number.
    """
    if any(_is_plain_row(line, len(names)) for _, line in content):
        return
    has_marks = any(_URSCRIPT_POSE.search(line) for _, line in content)
    for number, line in content:
        bracketed = _brackets(line)
        if bracketed is None or _SETTING.search(line) or (has_marks and not _URSCRIPT_POSE.search(line)):
            continue
        if _has_several_poses(bracketed, len(names)):
            raise DatasetError(path, "several poses in one line: write one pose per line", number)
        values = _named_values(bracketed, names) or _listed_values(bracketed, names)
        if values is not None:
            yield TextRow(number, _leading_image(line, bracketed) | dict(zip(names, values, strict=True)))
        elif _POSE_CLAIM.search(line):
            count = count_text(count_numbers(bracketed), "number")
            raise DatasetError(path, f"{count} in brackets, expected {', '.join(names)}", number)


def _is_plain_row(line: str, count: int) -> bool:
    """Whether a line has `count` numbers outside brackets; brackets may hold an index, as in `P[1]`."""
    closed, rest = " ".join(_BRACKETED.findall(line)), _BRACKETED.sub("", line)
    opened = _brackets(rest) or ""
    numbers = filter(_is_number, re.split(r"[;,\s]+", rest.removesuffix(opened)))
    return count_numbers(f"{closed} {opened}") < count <= len(list(numbers))


def _brackets(line: str) -> str | None:
    """Text of a line from its first bracket on; None if no number follows the bracket, as in `x [mm]`."""
    start = min((line.find(c) for c in "[({" if c in line), default=-1)
    return line[start:] if start >= 0 and _NUMBER.search(line[start:]) else None


def _bracketed_lists(text: str) -> list[list[str]]:
    """Numbers between successive brackets; empty lists are left out."""
    return list(filter(None, map(_LISTED_NUMBER.findall, re.split(r"[\[\](){}]", text))))


def _has_several_poses(text: str, count: int) -> bool:
    """Whether a pattern of lists repeats, with at least `count` numbers per repetition."""
    lengths = list(map(len, _bracketed_lists(text)))
    periods = (n for n in range(1, len(lengths) // 2 + 1) if lengths == lengths[:n] * (len(lengths) // n))
    return any(sum(lengths[:n]) >= count for n in periods)


def _named_values(text: str, names: Sequence[str]) -> list[str] | None:
    """Numbers that follow their names, as in KUKA's notation; None if a name is missing."""
    named = {name.lower(): value for name, value in _NAMED_NUMBER.findall(text)}
    return [named[name.lower()] for name in names] if all(name.lower() in named for name in names) else None


def _listed_values(text: str, names: Sequence[str]) -> list[str] | None:
    """First numbers of a text, if they are one bracketed list or end at a bracket; None otherwise.

    Further numbers are ignored: ABB's targets end with configuration and external axes. Lists with another length,
    such as ABB's joint targets, give None.
    """
    values: list[str] = []
    if _NAMED_FIELDS.search(text):
        return None
    lists = _bracketed_lists(text)
    if list(map(len, lists)) == [1, len(names)]:
        return lists[1]  # after a status code, as in the output of xArm's `get_position`
    for each in lists:
        values += each
        if len(values) >= len(names):
            return values[: len(names)] if len(values) == len(names) or each is lists[0] else None
    return None


def _header(line: str) -> tuple[str | None, tuple[str, ...]] | None:
    """Separator and cells of a line, if no cell is a number or an image; None otherwise."""
    plain = line.lstrip("#%!").strip()
    separator = _separator(plain)
    cells = _split(plain, separator)
    if any(_is_number(cell) for cell in cells) or any(map(is_image, cells)):
        return None
    return separator, tuple(cells)


def _split(line: str, separator: str | None) -> list[str]:
    """Split a line into cells; cells in double quotes may contain the separator."""
    cells = line.split(separator)
    if separator is not None and '"' in line:
        with suppress(csv.Error):  # a cell exceeds the size limit of csv
            cells = next(csv.reader([line], delimiter=separator, skipinitialspace=True))
    return [cell.strip().strip("\"'") for cell in cells]


def _is_number(cell: str) -> bool:
    return bool(_NUMBER.fullmatch(cell.strip()) or _DECIMAL_COMMA.fullmatch(cell.strip()))


def _separator(line: str) -> str | None:
    if all(_DECIMAL_COMMA.fullmatch(word) or _NUMBER.fullmatch(word) for word in line.split()) and " " in line.strip():
        return None
    return next((each for each in _SEPARATORS if each is not None and each in line), None)


def _cells(
    line: str, separator: str | None, header: tuple[str, ...] | None, names: Sequence[str], path: str, number: int
) -> dict[str, str]:
    cells = _split(line, separator)
    expected = names if header is None else header
    while len(cells) > len(expected) and not cells[-1]:
        cells.pop()
    if header is None and len(cells) == len(names) + 1 and is_image(cells[0]):
        return dict(zip(("image", *names), cells, strict=True))
    if len(cells) > len(expected) or (header is None and len(cells) < len(expected)):
        raise DatasetError(path, _count_message(cells, expected, separator, header is None), number)
    return dict(zip(expected, cells, strict=False))  # cells at the end of a row may be missing


def _leading_image(line: str, pose_text: str) -> dict[str, str]:
    """Image name before a pose in brackets, under the key `image`; empty if there is none."""
    first_cell = re.split(r"[,;\t ]", line[: len(line) - len(pose_text)].strip())[0].strip("\"'")
    return {"image": first_cell} if is_image(first_cell) else {}


def _count_message(cells: Sequence[str], columns: Sequence[str], separator: str | None, is_bare: bool) -> str:
    if separator == "," and len(columns) < len(cells) <= 2 * len(columns) and not any("." in c for c in cells):
        what = f"{len(cells)} cells for {len(columns)} columns"
        return f"{what}: decimal commas need another separator than a comma, such as a semicolon"
    expected = f"expected {', '.join(columns)}" if is_bare else f"the header has {len(columns)}"
    return f"{count_text(len(cells), 'column')}, {expected}"


def rows_of_numbers(table: TextTable, columns: Sequence[str]) -> Iterator[list[float]]:
    """Parse the numbers of each row in the given columns.

    Raises:
        DatasetError: if a cell is not a number, a row lacks a column, or a comma may separate thousands.
    """
    _check_decimal_signs(table, columns)
    for row in table.rows:
        yield [parse_number(table.cell(row, name), table.path, row.line, name) for name in columns]


def _check_decimal_signs(table: TextTable, columns: Sequence[str]) -> None:
    """Check that no number such as 1,234 stands beside others with a point: its comma may separate thousands."""
    cells = [(row.line, name, row.cells.get(name, "").strip("\"' ")) for row in table.rows for name in columns]
    comma = next((cell for cell in cells if "," in cell[2] and _PERHAPS_THOUSANDS.fullmatch(cell[2])), None)
    point = next((text for _, _, text in cells if "." in text), None) if comma else None
    if comma and point:
        what = f"{shorten(comma[2])} has a comma, {shorten(point)} a point: remove the thousands separators"
        raise DatasetError(table.path, f"{what}, or write one decimal sign", *comma[:2])
