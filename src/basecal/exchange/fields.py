"""Access to YAML and JSON files of other programs by field names; errors name path, line and field."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from basecal.cell.format.yaml_text import LARGEST_BYTES, parse_yaml, read_text
from basecal.errors import DatasetError, InputError, count_text, list_names, spelling_hint
from basecal.fields.problems import Loc, field_name, line_number, shorten
from basecal.fields.values import LARGEST_VALUE
from basecal.geometry import SE3

_END = re.compile(r"(\n(---|\.\.\.)[ \t]*)+\s*\Z")  # ROS prints a separator after every message


def parse_float(text: str) -> float:
    """Parse a number without Python's underscore notation, such as 1_0 for 10.

    Raises:
        ValueError: if the text is not a number.
    """
    if "_" in text:
        raise ValueError(text)
    return float(text)


@dataclass(frozen=True)
class Field:
    """A location in a file, and its content.

    Attributes:
        path: Path of the file.
        data: Content at the location, as plain data.
        lines: Line numbers of the file, from 1, by location.
        loc: Keys and indices of the location.
    """

    path: str
    data: Any
    lines: Mapping[Loc, int]
    loc: Loc = ()

    def error(self, message: str) -> DatasetError:
        """Create an error about this location."""
        return DatasetError(self.path, message, line_number(self.loc, self.lines), field_name(self.loc) or None)

    def first(self, *names: str) -> Field | None:
        """Return the first existing field of these names; None if there is none, or this is not a mapping."""
        found = [name for name in names if isinstance(self.data, dict) and self.data.get(name) is not None]
        return Field(self.path, self.data[found[0]], self.lines, (*self.loc, found[0])) if found else None

    def find(self, *names: str) -> Field:
        """Return the first existing field of these names.

        Raises:
            DatasetError: if there is none.
        """
        if (found := self.first(*names)) is not None:
            return found
        if not isinstance(self.data, dict):
            raise self.error(f"is {shorten(self.data)}, expected a mapping with {names[0]!r}")
        present = [name for name in self.data if self.data[name] is not None]
        raise self.error(f"has no {' or '.join(names)}{spelling_hint(names[0], present)}; it has {list_names(present)}")

    def names(self) -> list[str]:
        """Return the names of a mapping's fields; empty if this is not a mapping."""
        return [str(name) for name in self.data] if isinstance(self.data, dict) else []

    def items(self, kind: str) -> list[Field]:
        """Return the entries of a non-empty list; `kind` describes them in errors.

        Raises:
            DatasetError: if this is not a list, or the list is empty.
        """
        if not isinstance(self.data, list) or not self.data:
            found = "an empty list" if self.data == [] else shorten(self.data)
            raise self.error(f"is {found}, expected a list of {kind}")
        return [Field(self.path, item, self.lines, (*self.loc, i)) for i, item in enumerate(self.data)]

    def text(self) -> str:
        """Return the content as text.

        Raises:
            DatasetError: if the content is not text.
        """
        if not isinstance(self.data, str):
            raise self.error(f"is {shorten(self.data)}, expected text")
        return self.data

    def boolean(self) -> bool:
        """Return the content as a boolean; 0 and 1 are allowed, as in OpenCV's FileStorage.

        Raises:
            DatasetError: if the content is not a boolean.
        """
        if not isinstance(self.data, int) or self.data not in (0, 1):
            raise self.error(f"is {shorten(self.data)}, expected true or false")
        return bool(self.data)

    def number(self) -> float:
        """Return the content as a finite number within +-1e6.

        Raises:
            DatasetError: if the content is not such a number.
        """
        data = self.data
        is_number = isinstance(data, int | float) and not isinstance(data, bool)
        if not is_number or (isinstance(data, float) and not math.isfinite(data)):
            raise self.error(f"is {shorten(data)}, expected a number")
        if abs(data) > LARGEST_VALUE:
            raise self.error(f"is {shorten(data)}, beyond {LARGEST_VALUE:g}")
        return float(data)

    def integer(self, low: int = 1) -> int:
        """Return the content as a whole number of at least `low`.

        Raises:
            DatasetError: if the content is not such a number.
        """
        number = self.number()
        if number != int(number) or number < low:
            raise self.error(f"is {shorten(self.data)}, expected a whole number from {low}")
        return int(number)

    def numbers(self, *counts: int) -> list[float]:
        """Return a list of numbers; a list of lists is flattened row by row.

        Args:
            counts: Allowed lengths; any length if not given.

        Raises:
            DatasetError: if the content is not such a list.
        """
        entries = self.items("numbers") if self.data != [] else []
        if entries and all(isinstance(entry.data, list) for entry in entries):
            values = [each.number() for entry in entries for each in entry.items("numbers")]
        else:
            values = [entry.number() for entry in entries]
        if counts and len(values) not in counts:
            raise self.error(f"has {count_text(len(values), 'number')}, expected {' or '.join(map(str, counts))}")
        return values

    def matrix(self, *counts: int) -> list[float]:
        """Return the numbers of a matrix, which may be in a field `data` of a mapping; see `numbers`."""
        return (self.find("data") if isinstance(self.data, dict) else self).numbers(*counts)

    def size(self) -> tuple[int, int]:
        """Return width and height from a list of two whole numbers.

        Raises:
            DatasetError: if the content is not such a list.
        """
        sides = self.items("width and height")
        if len(sides) != 2:
            raise self.error(f"has {count_text(len(sides), 'number')}, expected width and height")
        return sides[0].integer(), sides[1].integer()

    def pose(self) -> SE3:
        """Return a transform [m]: `translation` and `rotation` as in ROS, a mapping x ... qw, or a 4x4 matrix.

        Raises:
            DatasetError: if the content is not a transform.
        """
        try:
            if isinstance(self.data, list):
                return SE3.from_matrix([self.numbers(16)[i : i + 4] for i in range(0, 16, 4)])
            position, rotation, prefix = self, self, "q"
            if self.first("translation", "position") is not None:
                position, rotation, prefix = (
                    self.find("translation", "position"),
                    self.find("rotation", "orientation"),
                    "",
                )
            quaternion = [rotation.find(f"{prefix}{axis}").number() for axis in "xyzw"]
            return SE3.from_quaternion(quaternion, [position.find(axis).number() for axis in "xyz"], "quaternion")
        except DatasetError:
            raise
        except InputError as error:
            raise self.error(str(error)) from None


def read_fields(path: str | Path, largest: int = LARGEST_BYTES) -> Field:
    """Read a YAML or JSON file.

    Args:
        path: Path of the file.
        largest: Largest allowed size [bytes].

    Raises:
        DatasetError: if the file cannot be read.
    """
    return parse_fields(read_text(Path(path), "", largest), str(path))


def parse_fields(text: str, path: str) -> Field:
    """Parse a YAML or JSON text.

    Raises:
        DatasetError: if the text is neither.
    """
    document = parse_yaml(_END.sub("\n", text), path)
    return Field(path, document.data, document.lines)
