"""YAML and JSON of other programs, requested by the names of their fields; an error names path, line and field."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from basecal.cell.format.yaml_text import LARGEST_BYTES, parse_yaml, read_text
from basecal.errors import DatasetError, InputError, list_names, nearest
from basecal.fields.problems import Loc, field_name, line_number, shorten
from basecal.fields.values import LARGEST_VALUE
from basecal.geometry import SE3

_END = re.compile(r"(\n(---|\.\.\.)[ \t]*)+\s*\Z")  # ROS ends every message that it prints with one


def written_number(text: str) -> float:
    """The number that a text is to other programs: not 1_0, which is 10 to Python alone.

    Raises:
        ValueError: if it is none.
    """
    if "_" in text:
        raise ValueError(text)
    return float(text)


@dataclass(frozen=True)
class Field:
    """A place in a file, and what is written there.

    Attributes:
        path: The file.
        data: What stands there, as plain data.
        lines: Of the file, from 1, by place.
        loc: Keys and indices that lead there.
    """

    path: str
    data: Any
    lines: Mapping[Loc, int]
    loc: Loc = ()

    def error(self, message: str) -> DatasetError:
        """The error at this place, to be raised."""
        return DatasetError(self.path, message, line_number(self.loc, self.lines), field_name(self.loc) or None)

    def first(self, *names: str) -> Field | None:
        """The first of these fields that is written; None if none is, or this is no mapping."""
        found = [name for name in names if isinstance(self.data, dict) and self.data.get(name) is not None]
        return Field(self.path, self.data[found[0]], self.lines, (*self.loc, found[0])) if found else None

    def find(self, *names: str) -> Field:
        """The first of these fields that is written.

        Raises:
            DatasetError: if none is.
        """
        if (found := self.first(*names)) is not None:
            return found
        if not isinstance(self.data, dict):
            raise self.error(f"is {shorten(self.data)}, expected a mapping with {names[0]!r}")
        there = [name for name in self.data if self.data[name] is not None]
        raise self.error(f"has no {' or '.join(names)}{nearest(names[0], there)}; it has {list_names(there)}")

    def names(self) -> list[str]:
        """Names of the fields of a mapping; none if it is no mapping."""
        return [str(name) for name in self.data] if isinstance(self.data, dict) else []

    def items(self, kind: str) -> list[Field]:
        """The entries of a list of `kind`, at least one.

        Raises:
            DatasetError: if it is no list, or an empty one.
        """
        if not isinstance(self.data, list) or not self.data:
            found = "an empty list" if self.data == [] else shorten(self.data)
            raise self.error(f"is {found}, expected a list of {kind}")
        return [Field(self.path, item, self.lines, (*self.loc, i)) for i, item in enumerate(self.data)]

    def text(self) -> str:
        """A word.

        Raises:
            DatasetError: if it is none.
        """
        if not isinstance(self.data, str):
            raise self.error(f"is {shorten(self.data)}, expected text")
        return self.data

    def boolean(self) -> bool:
        """Yes or no, also as a number, as the FileStorage of OpenCV has it.

        Raises:
            DatasetError: if it is neither.
        """
        if not isinstance(self.data, int) or self.data not in (0, 1):
            raise self.error(f"is {shorten(self.data)}, expected true or false")
        return bool(self.data)

    def number(self) -> float:
        """A finite number of a size that arithmetic bears.

        Raises:
            DatasetError: if it is none.
        """
        data = self.data
        is_number = isinstance(data, int | float) and not isinstance(data, bool)
        if not is_number or (isinstance(data, float) and not math.isfinite(data)):
            raise self.error(f"is {shorten(data)}, expected a number")
        if abs(data) > LARGEST_VALUE:
            raise self.error(f"is {shorten(data)}, beyond {LARGEST_VALUE:g}")
        return float(data)

    def integer(self, low: int = 1) -> int:
        """A whole number from `low`.

        Raises:
            DatasetError: if it is none.
        """
        number = self.number()
        if number != int(number) or number < low:
            raise self.error(f"is {shorten(self.data)}, expected a whole number from {low}")
        return int(number)

    def numbers(self, *counts: int) -> list[float]:
        """A list of numbers, also one of lists, row by row.

        Args:
            counts: How many there may be; any where none is given.

        Raises:
            DatasetError: if it is something else.
        """
        entries = self.items("numbers") if self.data != [] else []
        if entries and all(isinstance(entry.data, list) for entry in entries):
            values = [each.number() for entry in entries for each in entry.items("numbers")]
        else:
            values = [entry.number() for entry in entries]
        if counts and len(values) not in counts:
            raise self.error(f"has {len(values)} numbers, expected {' or '.join(map(str, counts))}")
        return values

    def matrix(self, *counts: int) -> list[float]:
        """The numbers of a matrix, which may stand beside its `rows` and `cols`; otherwise as `numbers`."""
        return (self.find("data") if isinstance(self.data, dict) else self).numbers(*counts)

    def size(self) -> tuple[int, int]:
        """Width and height, a list of two whole numbers.

        Raises:
            DatasetError: if it is none.
        """
        sides = self.items("width and height")
        if len(sides) != 2:
            raise self.error(f"has {len(sides)} numbers, expected width and height")
        return sides[0].integer(), sides[1].integer()

    def pose(self) -> SE3:
        """A transform in metres: `translation` and `rotation` as ROS writes them, x ... qw beside each other, or 4x4.

        Raises:
            DatasetError: if it is none.
        """
        try:
            if isinstance(self.data, list):
                return SE3.from_matrix([self.numbers(16)[i : i + 4] for i in range(0, 16, 4)])
            place, turn, mark = self, self, "q"
            if self.first("translation", "position") is not None:
                place, turn, mark = self.find("translation", "position"), self.find("rotation", "orientation"), ""
            turns = [turn.find(f"{mark}{axis}").number() for axis in "xyzw"]
            return SE3.from_quaternion(turns, [place.find(axis).number() for axis in "xyz"], "quaternion")
        except DatasetError:
            raise
        except InputError as error:
            raise self.error(str(error)) from None


def read_fields(path: str | Path, largest: int = LARGEST_BYTES) -> Field:
    """All of a YAML or JSON file.

    Args:
        path: The file.
        largest: How many bytes it may have.

    Raises:
        DatasetError: if it cannot be read.
    """
    return parse_fields(read_text(Path(path), "", largest), str(path))


def parse_fields(text: str, path: str) -> Field:
    """All of a YAML or JSON text.

    Raises:
        DatasetError: if it is neither.
    """
    document = parse_yaml(_END.sub("\n", text), path)
    return Field(path, document.data, document.lines)
