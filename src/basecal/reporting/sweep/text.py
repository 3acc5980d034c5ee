"""A study's points as a table in plain text."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from basecal.reporting.statement.digits import two_digits

COLUMN_TITLES = (
    "solved",
    "median mm",
    "95% mm",
    "sigma mm",
    "median deg",
    "95% deg",
    "sigma deg",
    "NEES",
    "coverage",
    "ms",
)
"""Of the columns after the axes."""


def row_texts(point: Mapping[str, Any]) -> list[str]:
    """Texts of a point's row under `COLUMN_TITLES`; empty if it was not computed."""
    mm, deg, nees, coverage = point["error_mm"], point["error_deg"], point["nees"], point["coverage"]
    return [
        f"{point['solved']}/{point['trials']}",
        *(number(mm and mm[key]) for key in ("median", "p95")),
        number(point["sigma_mm"]),
        *(number(deg and deg[key]) for key in ("median", "p95")),
        number(point["sigma_deg"]),
        "" if nees is None else f"{nees['mean']:.2f} for {nees['expected']}",
        "" if coverage is None else f"{coverage['share']:.1%}",
        f"{1e3 * point['time_s']:.3g}",
    ]


def number(value: float | None) -> str:
    """Two digits; nothing if there is no number."""
    return "" if value is None else two_digits(value)


def sweep_text(summary: Mapping[str, Any]) -> str:
    """The study's name, a row for each point, and why trials have no answer."""
    rows = [[*summary["axes"], *COLUMN_TITLES]]
    rows += [[*map(str, point["at"].values()), *row_texts(point)] for point in summary["points"]]
    widths = [max(len(row[k]) for row in rows) for k in range(len(rows[0]))]
    lines = ["  ".join(word.rjust(width) for word, width in zip(row, widths, strict=True)) for row in rows]
    reasons = dict.fromkeys(reason for point in summary["points"] for reason in point["reasons"])
    return "\n".join([summary["title"], *lines, *(f"no answer: {reason}" for reason in reasons)])
