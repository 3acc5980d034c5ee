"""Lines over an axis of a study, each with the band in which nine of ten errors lie."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from basecal.reporting.charts import Scale, fitted_scale, horizontal_rules
from basecal.reporting.figures.figure import Figure
from basecal.reporting.svg import drawing, element, label_lines, text, wrapped_label

_WIDTH, _HEIGHT = 640.0, 330.0
_LEFT, _RIGHT, _TOP, _BOTTOM = 62.0, 14.0, 12.0, 42.0
_CHARACTER, _LINE = 11.5, 22.0  # of the drawing, that a label takes at the size of letters on a narrow screen
_NUMBER = 12  # characters, which no number exceeds
_LABEL = 36.0  # of the drawing, that a label of the axis takes: one nearer to the last is left out
COLOURS = 6
"""Lines that a figure can distinguish."""


@dataclass(frozen=True)
class Band:
    """The median at a value of the axis, and the ends of the band; all None if there is no answer."""

    at: float | str
    low: float | None
    middle: float | None
    high: float | None


@dataclass(frozen=True)
class Line:
    """A named line."""

    name: str
    bands: tuple[Band, ...]


def curves(title: str, axis: str, unit: str, lines: Sequence[Line]) -> Figure:
    """Medians over an axis, joined, with their bands; at most `COLOURS` lines.

    Args:
        title: What it is of.
        axis: Name of the axis.
        unit: Of the errors.
        lines: All with the same values of the axis.
    """
    places = [band.at for band in lines[0].bands]
    along = _axis_positions(places)
    values = [value for line in lines for band in line.bands for value in (band.low, band.high) if value is not None]
    up = fitted_scale(values or [1.0], _HEIGHT - _BOTTOM, _TOP)
    parts = horizontal_rules(up, _LEFT, _WIDTH - _RIGHT)
    column = (_WIDTH - _LEFT - _RIGHT) / len(places)
    characters = _NUMBER if _is_by_size(places) else int(column / _CHARACTER)
    labelled, line_count = -math.inf, 1
    for place in sorted(set(places), key=along.__getitem__):
        label = f"{place:g}" if isinstance(place, float) else str(place)
        parts.append(element("path", class_="rule", d=f"M{along[place]:.1f} {_TOP}V{_HEIGHT - _BOTTOM}"))
        if along[place] - labelled < _LABEL:
            continue
        labelled = along[place]
        line_count = max(line_count, len(label_lines(label, characters)))
        parts.append(wrapped_label(label, characters, (along[place], _HEIGHT - _BOTTOM + 18), "middle"))
    parts += [_line(k, line, along, up) for k, line in enumerate(lines)]
    svg = drawing(_WIDTH, _HEIGHT + (line_count - 1) * _LINE, f"{title} over {axis}", *parts)
    caption = f"{axis} across, errors [{unit}] upwards: the median, and the band from 5 % to 95 % of the trials."
    return Figure(title, svg, caption)


def _axis_positions(places: Sequence[float | str]) -> dict[float | str, float]:
    """Where each value of the axis stands: by its size where all are numbers, else one after the other."""
    start, end = _LEFT, _WIDTH - _RIGHT
    if _is_by_size(places):
        numbers = [float(place) for place in places]
        scale = fitted_scale(numbers, start, end)
        return {place: scale.position(number) for place, number in zip(places, numbers, strict=True)}
    return {place: start + (k + 0.5) * (end - start) / len(places) for k, place in enumerate(places)}


def _is_by_size(places: Sequence[float | str]) -> bool:
    return all(isinstance(place, int | float) and not isinstance(place, bool) for place in places)


def _line(number: int, line: Line, positions: dict[float | str, float], scale: Scale) -> str:
    """A line and its band; broken where there is no answer."""
    kind = f"line-{number % COLOURS}"
    parts: list[str] = []
    # Bands with answers that are next to one another: value of the axis, low, middle and high of each.
    runs: list[list[tuple[float | str, float, float, float]]] = [[]]
    for band in line.bands:
        if band.low is not None and band.middle is not None and band.high is not None:
            runs[-1].append((band.at, band.low, band.middle, band.high))
        elif runs[-1]:
            runs.append([])
    for run in [run for run in runs if run]:
        ends = [
            (positions[at], scale.position(low), scale.position(middle), scale.position(high))
            for at, low, middle, high in run
        ]
        edge = [f"{x:.1f} {high:.1f}" for x, _, _, high in ends]
        back = [f"{x:.1f} {low:.1f}" for x, low, _, _ in reversed(ends)]
        parts.append(element("path", class_="band", d=f"M{'L'.join([*edge, *back])}Z"))
        parts.append(element("path", class_="median", d="M" + "L".join(f"{x:.1f} {m:.1f}" for x, _, m, _ in ends)))
        parts += [element("path", class_="whisker", d=f"M{x:.1f} {low:.1f}V{high:.1f}") for x, low, _, high in ends]
        parts += [element("circle", cx=f"{x:.1f}", cy=f"{middle:.1f}", r=3.5) for x, _, middle, _ in ends]
    return element("g", element("title", text(line.name)), *parts, class_=kind)
