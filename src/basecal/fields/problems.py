"""Everything wrong with a file, listed at once, each with its line and field."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

from basecal.errors import DatasetError

Loc = tuple[str | int, ...]
SHORT_LENGTH = 60
"""Characters of a value in a message: what a line still has room for."""

CAUSE_LENGTH = 200
"""Characters of another library's message, of which the first say what is wrong."""

_LONGEST_NAME = 100  # characters of a key in a message: those that people write are shorter
_HUGE_BITS = 64  # of a whole number that is not written out


class Problem(NamedTuple):
    """A problem at a place of a file; `loc` are the keys and indices that lead there."""

    loc: Loc
    message: str


def field_name(loc: Loc) -> str:
    """The place as a reader would write it, on one short line: `cameras.wrist.size_px[0]`."""
    text = ""
    for part in loc:
        name = str(part).replace("\n", "\\n")
        name = name if len(name) <= _LONGEST_NAME else f"{name[:_LONGEST_NAME]}..."
        text += f"[{name}]" if isinstance(part, int) else f".{name}"
    return text.removeprefix(".")


def shorten(value: Any) -> str:
    """A value in a few characters, whatever it is."""
    if isinstance(value, dict):
        return "a mapping"
    if isinstance(value, list):
        return f"a list of {len(value)}"
    if isinstance(value, int) and value.bit_length() > _HUGE_BITS:
        return "a huge integer"
    text = repr(value)
    return text if len(text) <= SHORT_LENGTH else f"{text[:SHORT_LENGTH]}..."


def line_number(loc: Loc, lines: Mapping[Loc, int]) -> int | None:
    """Line of a place, or of the nearest thing around it that is written."""
    for end in range(len(loc), -1, -1):
        if loc[:end] in lines:
            return lines[loc[:end]]
    return None


def dataset_error(path: str, problems: Iterable[Problem], lines: Mapping[Loc, int]) -> DatasetError:
    """One error that lists every problem on a line of its own, in the order of the file."""
    distinct = {(line_number(p.loc, lines) or 0, field_name(p.loc), p.message): p for p in problems}
    errors = [
        DatasetError(path, problem.message, line or None, field or None)
        for (line, field, _), problem in sorted(distinct.items(), key=lambda item: item[0])
    ]
    first, rest = errors[0], errors[1:]
    return DatasetError(path, "\n".join([first.reason, *map(str, rest)]), first.line, first.field)
