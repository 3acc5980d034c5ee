"""A study of many points as one HTML file that opens offline."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import combinations, product
from typing import Any

from basecal.reporting.figures.curves import COLOURS, Band, curves
from basecal.reporting.figures.figure import Figure
from basecal.reporting.figures.heat_map import heat_map
from basecal.reporting.sweep.text import COLUMN_TITLES, row_texts
from basecal.reporting.templates.environment import fill_page

_QUANTITIES = (("error_mm", "error of the translation", "mm"), ("error_deg", "error of the rotation", "deg"))
_MOST_TILES = 40  # along a side of a map
_MOST_MAPS = 6
_MOST_ROWS = 1000


def sweep_page(summary: Mapping[str, Any], file: str) -> str:
    """The study as HTML, everything it needs inside; it asks nothing of any server.

    Args:
        summary: As `studies.summary` gives it.
        file: The study's own file.
    """
    reasons = dict.fromkeys(reason for point in summary["points"] for reason in point["reasons"])
    rows = [[*map(str, point["at"].values()), *row_texts(point)] for point in summary["points"]]
    return fill_page(
        "study.html",
        summary=summary,
        groups=[(axis, _curves(summary, axis)) for axis in _varied_axes(summary)],
        maps=_maps(summary),
        head=[*summary["axes"], *COLUMN_TITLES],
        rows=rows[:_MOST_ROWS],
        row_count=len(rows),
        reasons=list(reasons),
        file=file,
    )


def _varied_axes(summary: Mapping[str, Any]) -> list[str]:
    return [axis for axis, values in summary["axes"].items() if len(values) > 1]


def _other_combinations(summary: Mapping[str, Any], axes: Sequence[str]) -> list[dict[str, Any]]:
    """Every combination of values of the other axes."""
    left = {axis: values for axis, values in summary["axes"].items() if axis not in axes}
    return [dict(zip(left, values, strict=True)) for values in product(*left.values())]


def _points(summary: Mapping[str, Any], values: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """The points that have these values."""
    return [p for p in summary["points"] if all(p["at"][axis] == value for axis, value in values.items())]


def _value_text(values: Mapping[str, Any]) -> str:
    return ", ".join(f"{axis} {value}" for axis, value in values.items())


def _curves(summary: Mapping[str, Any], axis: str) -> tuple[list[Figure], list[str]]:
    """Errors over an axis, and the lines' names: a line for each combination of the others, as many as can be
    determined.
    """
    others = {_value_text(at): at for at in _other_combinations(summary, [axis])[:COLOURS]}
    figures = []
    for key, title, unit in _QUANTITIES:
        lines = {
            name: [Band(point["at"][axis], _ends(point[key])) for point in _points(summary, at)]
            for name, at in others.items()
        }
        figures.append(curves(title, axis, unit, lines))
    return figures, [name for name in others if name]


def _ends(spread: Mapping[str, float] | None) -> tuple[float, float, float] | None:
    return None if spread is None else (spread["p05"], spread["median"], spread["p95"])


def _maps(summary: Mapping[str, Any]) -> list[Figure]:
    """Median errors over every two axes, a map for each combination of the others."""
    maps = []
    axes = [axis for axis in _varied_axes(summary) if len(summary["axes"][axis]) <= _MOST_TILES]
    for down, across in combinations(axes, 2):
        for at in _other_combinations(summary, [down, across]):
            by_place = {(p["at"][down], p["at"][across]): p["error_mm"] for p in _points(summary, at)}
            values = [
                [(spread := by_place[d, a]) and spread["median"] for a in summary["axes"][across]]
                for d in summary["axes"][down]
            ]
            title = f"error of the translation{f', {_value_text(at)}' if at else ''}"
            maps.append(heat_map(title, (across, summary["axes"][across]), (down, summary["axes"][down]), values))
    return maps[:_MOST_MAPS]
