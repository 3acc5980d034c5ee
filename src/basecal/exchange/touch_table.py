"""Tables of touches: what was touched by which tip; and rows that make samples of their own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

from basecal.cell import Cell
from basecal.errors import UsageError
from basecal.exchange.columns import read_table_text
from basecal.exchange.importing.cell_content import recorded_samples
from basecal.exchange.importing.imported import Row
from basecal.exchange.importing.text_table import TextTable, as_name, read_text_table, select_robot


@dataclass(frozen=True)
class TouchTable:
    """A file, the names of its numbers where it has no header, and whose rows are read where a column names robots."""

    path: str
    names: Sequence[str]
    robot: str

    @cached_property
    def table(self) -> TextTable:
        """Its cells, of the robot's rows."""
        text = read_table_text(self.path, "a table of touches")
        return select_robot(read_text_table(text, self.path, self.names), self.robot)

    def column(self, *names: str) -> list[str] | None:
        """The cells of the first of these columns that there is, as names of a cell; None if there is none."""
        header = {column.strip().lower(): column for column in self.table.header or ()}
        found = next((header[name] for name in names if name in header), None)
        return None if found is None else [as_name(self.table.cell(row, found)) for row in self.table.rows]


def touch_names(table: TouchTable, mark: str | None) -> list[str]:
    """The marks that were touched, one for each row.

    Args:
        table: The file.
        mark: What all touched, if the file does not say.

    Raises:
        UsageError: if neither a column nor `mark` says what was touched, or both do.
    """
    marks = table.column("mark", "touch", "point", "target")
    if (marks is None) == (mark is None):
        why = "the table has no column `mark`" if mark is None else "the table has a column `mark`, too"
        raise UsageError(f"{why}: say by --mark or by the column what was touched")
    return [mark or ""] * len(table.table.rows) if marks is None else marks


def new_rows(folder: str | Path, cell: Cell | None, rows: Sequence[Row]) -> list[Row]:
    """Rows that are samples of their own, after those that are recorded; numbers that rows have stay."""
    recorded = () if cell is None else recorded_samples(folder, cell)
    first = max((sample.sample for sample in recorded), default=-1) + 1
    return [replace(row, sample=first + k if row.sample is None else row.sample) for k, row in enumerate(rows)]
