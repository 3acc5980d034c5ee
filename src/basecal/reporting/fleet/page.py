"""A fleet as one HTML file that opens offline."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from basecal.reporting.fleet.text import COLUMN_TITLES, number_text, row_texts, sort_by_verdict, verdict_counts
from basecal.reporting.templates.environment import fill_page

_MOST_ROWS = 2000
_COLUMN_NAMES = {
    "sigma_mm": "sigma of the translation, 3-D norm [mm]",
    "sigma_deg": "sigma of the rotation, 3-D norm [deg]",
    "held_out_mm": "held-out error [mm]",
    "held_out_deg": "held-out error [deg]",
    "time_s": "time of a cell [s]",
}


def fleet_page(summary: Mapping[str, Any], rows: Sequence[Mapping[str, Any]]) -> str:
    """The fleet as HTML, everything it needs inside; it asks nothing of any server.

    Args:
        summary: As `studies.fleet.summary` gives it.
        rows: Of all cells, as the table has them.
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
