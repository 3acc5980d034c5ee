"""A study of many points as one HTML file that opens offline."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import combinations, islice
from typing import Any

from basecal.fields.digits import two_digits
from basecal.reporting.figures.curves import COLOURS, Band, curves
from basecal.reporting.figures.heat_map import heat_map
from basecal.reporting.svg import Figure
from basecal.reporting.templates.environment import fill_page

_QUANTITIES = (("error_mm", "error of the translation", "mm"), ("error_deg", "error of the rotation", "deg"))
_MOST_TILES = 40  # along a side of a map
_MOST_MAPS = 6
_MOST_ROWS = 1000
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
"""Titles of the columns after the axes."""


def sweep_page(summary: Mapping[str, Any], file: str) -> str:
    """The study as a self-contained HTML page without external requests.

    Args:
        summary: Summary from `studies.summary`.
        file: Text of the study's file.
    """
    head, *rows = table_rows(summary)
    varied = [axis for axis, values in summary["axes"].items() if len(values) > 1]
    return fill_page(
        "study.html",
        summary=summary,
        groups=[(axis, _curves(summary, axis)) for axis in varied],
        maps=_maps(summary),
        head=head,
        rows=rows[:_MOST_ROWS],
        reasons=failure_reasons(summary),
        file=file,
    )


def _groups(summary: Mapping[str, Any], axes: Sequence[str]) -> dict[str, list[Mapping[str, Any]]]:
    """Groups of points that differ only along given axes, by the values of the other axes."""
    groups: dict[str, list[Mapping[str, Any]]] = {}
    for point in summary["points"]:
        others = (f"{axis} {value}" for axis, value in point["at"].items() if axis not in axes)
        groups.setdefault(", ".join(others), []).append(point)
    return groups


def _curves(summary: Mapping[str, Any], axis: str) -> tuple[list[Figure], list[str]]:
    """Figures of errors over an axis, and the lines' names: a line for each combination of the others.

    At most `COLOURS` lines are drawn.
    """
    groups = dict(islice(_groups(summary, [axis]).items(), COLOURS))
    figures = []
    for key, title, unit in _QUANTITIES:
        lines = {
            name: [Band(point["at"][axis], _ends(point[key])) for point in points] for name, points in groups.items()
        }
        caption = f"{axis} across, errors [{unit}] upwards: the median, and the band from 5 % to 95 % of the trials."
        figures.append(Figure(title, curves(title, axis, unit, lines), caption))
    return figures, list(filter(None, groups))


def _ends(spread: Mapping[str, float] | None) -> tuple[float, float, float] | None:
    return None if spread is None else (spread["p05"], spread["median"], spread["p95"])


def _maps(summary: Mapping[str, Any]) -> list[Figure]:
    """Maps of median errors over each pair of axes, one for each combination of the others."""
    maps, sizes = [], {axis: values for axis, values in summary["axes"].items() if 1 < len(values) <= _MOST_TILES}
    for (down, rows), (across, columns) in combinations(sizes.items(), 2):
        for name, points in _groups(summary, [down, across]).items():
            spreads = {(point["at"][down], point["at"][across]): point["error_mm"] for point in points}
            values = [[(spread := spreads[d, a]) and spread["median"] for a in columns] for d in rows]
            title = ", ".join(filter(None, ("error of the translation", name)))
            maps.append(heat_map(title, (across, columns), (down, rows), values))
    return maps[:_MOST_MAPS]


def row_texts(point: Mapping[str, Any]) -> list[str]:
    """Texts of a point's row under `COLUMN_TITLES`; empty for missing values."""
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
    """A number with two significant digits; empty for None."""
    return "" if value is None else two_digits(value)


def table_rows(summary: Mapping[str, Any]) -> list[list[str]]:
    """The head of a study's table, and a row for each point."""
    rows = [[*map(str, point["at"].values()), *row_texts(point)] for point in summary["points"]]
    return [[*summary["axes"], *COLUMN_TITLES], *rows]


def failure_reasons(summary: Mapping[str, Any]) -> list[str]:
    """Reasons for trials without a result, each once."""
    return list(dict.fromkeys(reason for point in summary["points"] for reason in point["reasons"]))


def sweep_text(summary: Mapping[str, Any]) -> str:
    """Text with the study's title, a row for each point, and reasons for trials without a result."""
    rows = table_rows(summary)
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = ["  ".join(word.rjust(width) for word, width in zip(row, widths, strict=True)) for row in rows]
    return "\n".join([summary["title"], *lines, *(f"no answer: {reason}" for reason in failure_reasons(summary))])
