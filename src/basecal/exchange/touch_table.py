"""Tables of touches: what was touched by which tip; and rows that make samples of their own."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

from basecal.cell import Cell
from basecal.errors import DatasetError, UsageError
from basecal.exchange.columns import read_table_text
from basecal.exchange.importing.cell_content import recorded_samples
from basecal.exchange.importing.imported import Row
from basecal.exchange.importing.text_table import TextTable, read_text_table


@dataclass(frozen=True)
class TouchTable:
    """A file, and the names of its numbers where it has no header."""

    path: str
    names: Sequence[str]

    @cached_property
    def table(self) -> TextTable:
        """Its cells."""
        return read_text_table(read_table_text(self.path, "a table of touches"), self.path, self.names)

    def column(self, *names: str) -> list[str] | None:
        """The cells of the first of these columns that there is, as names of a cell; None if there is none."""
        header = {column.strip().lower(): column for column in self.table.header or ()}
        found = next((header[name] for name in names if name in header), None)
        return None if found is None else [as_name(self.table.cell(row, found)) for row in self.table.rows]


def as_name(text: str) -> str:
    """A name as a cell has it: small letters, digits and _, a letter first."""
    plain = re.sub(r"[^a-z0-9]+", "_", text.strip().strip("\"'").lower()).strip("_")
    return plain if plain[:1].isalpha() else f"mark_{plain}"


def touch_names(table: TouchTable, rows: Sequence[Row], robot: str, mark: str | None) -> tuple[list[Row], list[str]]:
    """The rows of a robot, and what each touched.

    Args:
        table: The file.
        rows: One for each of the file's rows.
        robot: Whose rows are kept, where a column names robots.
        mark: What all touched, if the file does not say.

    Raises:
        UsageError: if neither a column nor `mark` says what was touched, or both do.
        DatasetError: if no row is of the robot.
    """
    marks = table.column("mark", "touch", "point", "target")
    if (marks is None) == (mark is None):
        why = "the table has no column `mark`" if mark is None else "the table has a column `mark`, too"
        raise UsageError(f"{why}: say by --mark or by the column what was touched")
    robots = table.column("robot", "arm")
    kept = [k for k in range(len(rows)) if robots is None or robots[k] == robot]
    if not kept:
        there = ", ".join(dict.fromkeys(robots or ()))
        raise DatasetError(table.path, f"no row is of robot {robot!r}; there are: {there}", field="robot")
    return [rows[k] for k in kept], [(mark or "") if marks is None else marks[k] for k in kept]


def new_rows(folder: str | Path, cell: Cell | None, rows: Sequence[Row]) -> list[Row]:
    """Rows that are samples of their own, after those that are recorded; numbers that rows have stay."""
    recorded = () if cell is None else recorded_samples(folder, cell)
    first = max((sample.sample for sample in recorded), default=-1) + 1
    return [replace(row, sample=first + k if row.sample is None else row.sample) for k, row in enumerate(rows)]
