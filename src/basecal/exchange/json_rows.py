"""Conversion of JSON lists of poses to rows of a table: lists of numbers, or objects of numbers by name."""

from __future__ import annotations

import csv
import json
from collections.abc import Iterator
from io import StringIO
from typing import Any

_SEPARATOR = "."  # between the names of nested objects


def json_rows(text: str) -> str:
    """Convert a JSON list to rows of text, with a header if items are objects; empty for any other text."""
    if not text.lstrip().startswith(("[", "{")):
        return ""
    try:
        data = json.loads(text)
    except (ValueError, RecursionError):
        return ""
    if isinstance(data, dict):
        lists = [value for value in data.values() if isinstance(value, list)]
        data = lists[0] if len(lists) == 1 else None
    records = [dict(_leaves(each)) for each in data] if isinstance(data, list) else []
    if not records or not records[0] or any(each.keys() != records[0].keys() for each in records):
        return ""
    table = StringIO()
    lines = csv.writer(table, lineterminator="\n")
    if isinstance(data[0], dict):
        lines.writerow(records[0])
    lines.writerows([each[key] for key in records[0]] for each in records)
    return table.getvalue()


def _leaves(value: Any, name: str = "") -> Iterator[tuple[str, Any]]:
    """Values of nested objects and lists, with their joined names."""
    inner = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, each in inner:
        full = f"{name}{_SEPARATOR}{key}" if name else str(key)
        if isinstance(each, (dict, list)):
            yield from _leaves(each, full)
        else:
            yield full, each
