"""CSV tables whose header names the columns."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from basecal.errors import DatasetError
from basecal.geometry import Array


@dataclass(frozen=True, eq=False)
class Table:
    """Columns of numbers by name, and the line of the file each row stood in."""

    values: Mapping[str, Array]
    lines: Sequence[int]

    def stacked(self, names: Sequence[str]) -> Array:
        """Columns side by side, (rows, len(names))."""
        return np.stack([self.values[name] for name in names], -1)


def text_of(path: str, expected: str) -> str:
    """The text of a file, without a byte order mark.

    Raises:
        DatasetError: naming the file, if it cannot be read or is no text; it says what was `expected`.
    """
    try:
        return Path(path).read_text(encoding="utf-8-sig")
    except UnicodeDecodeError:
        raise DatasetError(path, f"not text, expected {expected}") from None
    except OSError as error:
        raise DatasetError(path, f"cannot be read: {error.strerror}") from None


def read_columns(path: str | Path, aliases: Mapping[str, Sequence[str]]) -> Table:
    """A table of finite numbers.

    Args:
        path: Comma-separated text; its first line is the header and may begin with `#`.
        aliases: Other names of a column by the name it is given here; case does not count.

    Raises:
        DatasetError: naming the file and line, if a cell is not a finite number or a row has another length.
    """
    name = str(path)
    text = text_of(name, "comma-separated values")
    reader = csv.reader(text.splitlines(), skipinitialspace=True)
    numbered = [(reader.line_num, row) for row in reader if any(cell.strip() for cell in row)]
    if not numbered:
        raise DatasetError(name, "is empty, expected a header that names the columns")
    known = {alias: name for name, others in aliases.items() for alias in (name, *others)}
    plain = [cell.lstrip("#").strip().lower() for cell in numbered[0][1]]
    header = [known.get(cell, cell) for cell in plain]
    if len(set(header)) != len(header):
        raise DatasetError(name, f"names a column twice: {', '.join(header)}", numbered[0][0])
    rows = [_numbers(name, line, row, header) for line, row in numbered[1:]]
    if not rows:
        raise DatasetError(name, "has a header and no rows")
    columns = np.array(rows).T
    return Table(dict(zip(header, columns, strict=True)), [line for line, _ in numbered[1:]])


def _numbers(path: str, line: int, row: Sequence[str], header: Sequence[str]) -> list[float]:
    if len(row) != len(header):
        raise DatasetError(path, f"{len(row)} columns, the header has {len(header)}", line)
    numbers = []
    for cell, name in zip(row, header, strict=True):
        try:
            numbers.append(float(cell))
        except ValueError:
            raise DatasetError(path, f"{cell!r} is not a number", line, name) from None
        if not np.isfinite(numbers[-1]):
            raise DatasetError(path, f"{cell!r} is not finite", line, name)
    return numbers
