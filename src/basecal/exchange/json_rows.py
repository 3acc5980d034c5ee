"""Conversion of JSON poses to rows of a table: lists of numbers, or objects of numbers by name."""

from __future__ import annotations

import csv
import json
import re
from collections.abc import Iterator
from io import StringIO
from itertools import pairwise
from typing import Any

from basecal.cell.journal.recording_file import MOST_SAMPLES
from basecal.errors import DatasetError
from basecal.fields.problems import shorten

_SEPARATOR = "."  # between the names of nested objects
_OBJECTS = re.compile(r"\s*\[?\s*\{\s*[\"']")  # start of objects, which no controller's program has
_GAP = re.compile(r"[\s,]*")


def json_rows(text: str) -> str:
    """Convert a JSON list of lists to rows of text; empty for any other text."""
    if not text.lstrip().startswith(("[", "{")):
        return ""
    try:
        data = json.loads(text)
    except (ValueError, RecursionError):
        return ""
    if isinstance(data, dict):
        data = next((value for value in data.values() if isinstance(value, list)), None)
    if not isinstance(data, list) or not all(isinstance(each, list) for each in data):
        return ""
    rows = [[value for _, value in _leaves(each)] for each in data]
    if not rows or not rows[0] or any(len(row) != len(rows[0]) for row in rows):
        return ""
    table = StringIO()
    csv.writer(table, lineterminator="\n").writerows(rows)
    return table.getvalue()


def json_records(text: str, path: str) -> list[tuple[int, dict[str, str]]]:
    """Line and cells by name of each object of a JSON list, or of an object on each line; empty for any other text.

    The list may be the only one in an object. Names of nested objects are joined.

    Raises:
        DatasetError: if the text starts with an object and is not JSON. It is also raised if a name is given twice, the
            list is ambiguous, or there are too many objects.
    """
    if not _OBJECTS.match(text):
        return []
    try:
        records = _records(text, path)
    except DatasetError:
        raise
    except json.JSONDecodeError as error:
        raise DatasetError(path, f"not JSON: {error.msg}; expected objects of numbers by name", error.lineno) from None
    except (ValueError, RecursionError):
        raise DatasetError(path, "not JSON: nested too deeply, or a number of thousands of digits") from None
    if all(isinstance(record, list) for _, record in records):
        return []
    for line, record in records:
        if not isinstance(record, dict):
            raise DatasetError(path, f"{shorten(record)} is among objects: expected numbers by name", line)
    if len(records) > MOST_SAMPLES:
        raise DatasetError(path, f"{len(records)} objects, expected at most {MOST_SAMPLES}")
    return [(line, {name: "" if each is None else str(each) for name, each in _leaves(item)}) for line, item in records]


def _records(text: str, path: str) -> list[tuple[int, Any]]:
    """Entries of the list in a JSON text, or of its lines, with the line of each."""

    def unique_names(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        """Object of pairs of a name and a value."""
        if len(found := dict(pairs)) != len(pairs):
            names = sorted(name for name, _ in pairs)
            twice = next(name for name, other in pairwise(names) if name == other)
            raise DatasetError(path, f"an object has the name {shorten(twice)} twice: keep one")
        return found

    decoder = json.JSONDecoder(object_pairs_hook=unique_names)
    first, _, rest = text.lstrip().partition("\n")
    if rest.strip() and _is_object(decoder, first):
        return [(k, _decode_line(decoder, line, k)) for k, line in enumerate(text.split("\n"), start=1) if line.strip()]
    data = decoder.decode(text)
    lists = (
        {key: value for key, value in data.items() if isinstance(value, list)} if isinstance(data, dict) else {"": data}
    )
    if not lists:
        return [(1, data)]
    if len(lists) > 1:
        raise DatasetError(path, f"holds the lists {', '.join(map(shorten, lists))}: expected one list of poses")
    ((key, entries),) = lists.items()
    start = text.find("[", text.find(json.dumps(key, ensure_ascii=False)) if key else 0)
    return list(zip(_lines(decoder, text, start, len(entries)), entries, strict=True))


def _is_object(decoder: json.JSONDecoder, line: str) -> bool:
    try:
        return isinstance(decoder.decode(line), dict)
    except json.JSONDecodeError:
        return False


def _decode_line(decoder: json.JSONDecoder, line: str, number: int) -> Any:
    try:
        return decoder.decode(line)
    except json.JSONDecodeError as error:
        error.lineno = number
        raise


def _lines(decoder: json.JSONDecoder, text: str, start: int, count: int) -> Iterator[int]:
    """Line of each entry of a list that starts at a position."""
    line, position, end = 1, 0, start + 1
    for _ in range(count):
        at = _GAP.match(text, end)
        assert at is not None
        line += text.count("\n", position, at.end())
        position = at.end()
        yield line
        _, end = decoder.raw_decode(text, position)


def _leaves(value: Any, name: str = "") -> Iterator[tuple[str, Any]]:
    """Values of nested objects and lists, with their joined names."""
    inner = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, each in inner:
        full = f"{name}{_SEPARATOR}{key}" if name else str(key)
        if isinstance(each, (dict, list)):
            yield from _leaves(each, full)
        else:
            yield full, each
