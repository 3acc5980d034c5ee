"""A fleet's verdicts in plain text, and the cells that need somebody."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from basecal.reporting.summary import wrap_text

COLUMN_TITLES = (
    *("cell", "verdict", "said", "findings", "transform"),
    *("sigma mm", "sigma deg", "held out mm", "held out deg", "samples", "s"),
)
"""Of the columns of a cell's row."""

VERDICT_ORDER = ("failed", "unreadable", "refused", "doubtful", "good")
"""Of verdicts, those that need somebody first."""

_NUMBER_COLUMNS = ("sigma_mm", "sigma_deg", "held_out_mm", "held_out_deg", "samples", "time_s")
_MOST_CELLS = 20  # cells that are told: the table and the page have all

Row = Mapping[str, Any]


def sort_by_verdict(rows: Sequence[Row]) -> list[Row]:
    """Cells by verdict, of one verdict by how well the answer is known."""
    return sorted(rows, key=lambda row: (VERDICT_ORDER.index(row["verdict"]), -(row["sigma_mm"] or 0.0), row["cell"]))


def row_texts(row: Row) -> list[str]:
    """What a cell's row says under `COLUMN_TITLES`; nothing if it was not computed."""
    numbers = ["" if row[name] is None else f"{row[name]:.3g}" for name in _NUMBER_COLUMNS]
    return [row["cell"], row["verdict"], row["said"], row["findings"], row["transform"] or "", *numbers]


def fleet_text(summary: Mapping[str, Any], rows: Sequence[Row]) -> str:
    """How many cells have which verdict, how well the answers are known, and the first that need somebody."""
    verdicts = ", ".join(f"{count} {verdict}" for verdict, count in summary["verdicts"].items() if count)
    lines = [f"{summary['cells']} cells: {verdicts}"]
    if summary["sigma_mm"] is not None:
        lines.append(f"sigma: median {summary['sigma_mm']['median']:.3g} mm, 95 % {summary['sigma_mm']['p95']:.3g} mm")
    waiting = [row for row in sort_by_verdict(rows) if row["verdict"] != "good"]
    for row in waiting[:_MOST_CELLS]:
        lines += wrap_text(f"{row['cell']}: {', '.join(filter(None, (row['verdict'], row['said'])))}")
    if len(waiting) > _MOST_CELLS:
        lines.append(f"and {len(waiting) - _MOST_CELLS} more")
    return "\n".join(lines)
