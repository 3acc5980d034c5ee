"""Problems of a file, reported together, each with its line and field."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

from basecal.errors import DatasetError

Loc = tuple[str | int, ...]
SHORT_LENGTH = 60
"""Largest number of characters of a value in a message."""

CAUSE_LENGTH = 200
"""Largest number of characters quoted from another library's message."""

_LONGEST_NAME = 100  # characters of a key in a message: usual keys are shorter
_HUGE_BITS = 64  # larger whole numbers are not printed in messages


class Problem(NamedTuple):
    """A problem at a location of a file; `loc` is the path of keys and indices."""

    loc: Loc
    message: str


def field_name(loc: Loc) -> str:
    """Format a location on one short line: `cameras.wrist.size_px[0]`."""
    text = ""
    for part in loc:
        name = str(part).replace("\n", "\\n")
        name = name if len(name) <= _LONGEST_NAME else f"{name[:_LONGEST_NAME]}..."
        text += f"[{name}]" if isinstance(part, int) else f".{name}"
    return text.removeprefix(".")


def shorten(value: Any) -> str:
    """Format any value in a few characters."""
    if isinstance(value, dict):
        return "a mapping"
    if isinstance(value, list):
        return f"a list of {len(value)}"
    if isinstance(value, int) and value.bit_length() > _HUGE_BITS:
        return "a huge integer"
    text = repr(value)
    return text if len(text) <= SHORT_LENGTH else f"{text[:SHORT_LENGTH]}..."


def line_number(loc: Loc, lines: Mapping[Loc, int]) -> int | None:
    """Line of a location, or of its nearest enclosing location with a line; None if there is none."""
    for end in range(len(loc), -1, -1):
        if loc[:end] in lines:
            return lines[loc[:end]]
    return None


def dataset_error(path: str, problems: Iterable[Problem], lines: Mapping[Loc, int]) -> DatasetError:
    """Combine problems into one error with one line per problem, in the order of the file."""
    distinct = {(line_number(p.loc, lines) or 0, field_name(p.loc), p.message): p for p in problems}
    errors = [
        DatasetError(path, problem.message, line or None, field or None)
        for (line, field, _), problem in sorted(distinct.items(), key=lambda item: item[0])
    ]
    first, rest = errors[0], errors[1:]
    return DatasetError(path, "\n".join([first.reason, *map(str, rest)]), first.line, first.field)
