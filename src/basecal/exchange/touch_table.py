"""Tables of touches: what was touched by which tip; and rows that make samples of their own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from basecal.errors import UsageError
from basecal.exchange.columns import read_table_text
from basecal.exchange.importing.cell_content import KnownCell, recorded_samples
from basecal.exchange.importing.imported import Row
from basecal.exchange.importing.text_table import read_text_table, select_robot


def touch_names(path: str, names: Sequence[str], robot: str, mark: str | None) -> list[str]:
    """The marks that a robot touched, one for each of its rows.

    Args:
        path: The file.
        names: Of the numbers of its rows where it has no header.
        robot: Whose rows are read where a column names robots.
        mark: What all touched, if the file does not say.

    Raises:
        UsageError: if neither a column nor `mark` says what was touched, or both do.
    """
    table = select_robot(read_text_table(read_table_text(path, "a table of touches"), path, names), robot)
    marks = table.names("mark", "touch", "point", "target")
    if (marks is None) == (mark is None):
        why = "the table has no column `mark`" if mark is None else "the table has a column `mark`, too"
        raise UsageError(f"{why}: say by --mark or by the column what was touched")
    return [mark or ""] * len(table.rows) if marks is None else marks


def new_rows(folder: str | Path, cell: KnownCell, rows: Sequence[Row]) -> tuple[Row, ...]:
    """Rows that are samples of their own, after those that are recorded; numbers that rows have stay."""
    first = max((sample.sample for sample in recorded_samples(folder, cell)), default=-1) + 1
    return tuple(replace(row, sample=first + k if row.sample is None else row.sample) for k, row in enumerate(rows))
