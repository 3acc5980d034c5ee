"""A fleet as one HTML file that opens offline."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from basecal.errors import count_text
from basecal.fields.digits import two_digits
from basecal.reporting.summary import wrap_text
from basecal.reporting.templates.environment import fill_page

_MOST_ROWS = 2000
_COLUMN_NAMES = {
    "sigma_mm": "sigma of the translation, 3-D norm [mm]",
    "sigma_deg": "sigma of the rotation, 3-D norm [deg]",
    "held_out_mm": "held-out error [mm]",
    "held_out_deg": "held-out error [deg]",
    "time_s": "time of a cell [s]",
}
_NUMBER_COLUMNS = ("sigma_mm", "sigma_deg", "held_out_mm", "held_out_deg", "samples", "time_s")
COLUMN_TITLES = ("cell", "verdict", "why", "transform", *(name.replace("_", " ") for name in _NUMBER_COLUMNS))
"""Titles of the columns of a cell's row."""

VERDICT_ORDER = ("failed", "unreadable", "refused", "doubtful", "good")
"""Order of verdicts, those that need attention first."""

_MOST_CELLS = 20  # cells listed in the text; the table and the page contain all

Row = Mapping[str, Any]


def fleet_page(summary: Mapping[str, Any], rows: Sequence[Mapping[str, Any]]) -> str:
    """The fleet as a self-contained HTML page without external requests.

    Args:
        summary: Summary from `studies.fleet.summary`.
        rows: Rows of all cells in the table.
    """
    shown = sort_by_verdict(rows)[:_MOST_ROWS]
    spreads = [(label, spread) for name, label in _COLUMN_NAMES.items() if (spread := summary[name])]
    return fill_page(
        "fleet.html",
        ("templates/table.js",),
        summary=summary,
        counts=verdict_counts(summary),
        spreads=[(label, *map(number_text, spread.values())) for label, spread in spreads],
        head=COLUMN_TITLES,
        worst=next((row["verdict"] for row in shown), "good"),
        rows=shown,
        row_texts=row_texts,
    )


def sort_by_verdict(rows: Sequence[Row]) -> list[Row]:
    """Sort cells by verdict, then by sigma, largest first."""
    return sorted(rows, key=lambda row: (VERDICT_ORDER.index(row["verdict"]), -(row["sigma_mm"] or 0.0), row["cell"]))


def number_text(value: float) -> str:
    """Text of a number: integers unchanged, others with two significant digits."""
    return str(value) if isinstance(value, int) else two_digits(value)


def row_texts(row: Row) -> list[str]:
    """Texts of a cell's row under `COLUMN_TITLES`; empty for missing values."""
    numbers = ["" if row[name] is None else number_text(row[name]) for name in _NUMBER_COLUMNS]
    return [row["cell"], row["verdict"], row["said"], row["transform"] or "", *numbers]


def verdict_counts(summary: Mapping[str, Any]) -> str:
    """Text with the number of cells of each verdict."""
    return ", ".join(f"{count} {verdict}" for verdict, count in summary["verdicts"].items() if count)


def fleet_text(summary: Mapping[str, Any], rows: Sequence[Row]) -> str:
    """Text with the number of cells of each verdict, the sigmas, and the first cells that need attention."""
    lines = [f"{count_text(summary['cells'], 'cell')}: {verdict_counts(summary)}"]
    if (spread := summary["sigma_mm"]) is not None:
        lines.append(f"sigma: median {two_digits(spread['median'])} mm, 95 % {two_digits(spread['p95'])} mm")
    waiting = [row for row in sort_by_verdict(rows) if row["verdict"] != "good"]
    for row in waiting[:_MOST_CELLS]:
        lines += wrap_text(f"{row['cell']}: {', '.join(filter(None, (row['verdict'], row['said'])))}")
    if len(waiting) > _MOST_CELLS:
        lines.append(f"and {len(waiting) - _MOST_CELLS} more")
    return "\n".join(lines)
