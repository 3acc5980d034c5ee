"""A study's points as a table in plain text."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from basecal.reporting.statement.verdict import two_digits

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


def table_rows(summary: Mapping[str, Any]) -> list[list[str]]:
    """The head of a study's table, and a row for each point."""
    rows = [[*map(str, point["at"].values()), *row_texts(point)] for point in summary["points"]]
    return [[*summary["axes"], *COLUMN_TITLES], *rows]


def failure_reasons(summary: Mapping[str, Any]) -> list[str]:
    """Why trials have no answer, each reason once."""
    return list(dict.fromkeys(reason for point in summary["points"] for reason in point["reasons"]))


def sweep_text(summary: Mapping[str, Any]) -> str:
    """The study's name, a row for each point, and why trials have no answer."""
    rows = table_rows(summary)
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = ["  ".join(word.rjust(width) for word, width in zip(row, widths, strict=True)) for row in rows]
    return "\n".join([summary["title"], *lines, *(f"no answer: {reason}" for reason in failure_reasons(summary))])
