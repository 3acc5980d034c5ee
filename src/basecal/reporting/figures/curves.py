"""Lines over an axis of a study, each with the band in which nine of ten errors lie."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby

from basecal.reporting.charts import Scale, fitted_scale, horizontal_rules
from basecal.reporting.figures.figure import Figure
from basecal.reporting.statement.digits import two_digits
from basecal.reporting.svg import drawing, element, label_lines, text, wrapped_label

WIDTH, HEIGHT = 640.0, 290.0
"""Of a drawing, if no label has several lines."""
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


def curves(
    title: str, axis: str, unit: str, lines: Sequence[Line], limit: float | None = None, logarithmic: bool | None = None
) -> Figure:
    """Medians over an axis, joined, with their bands; at most `COLOURS` lines.

    Args:
        title: What it is of.
        axis: Name of the axis.
        unit: Of the errors.
        lines: Values of the axis in the order of the first.
        limit: A dashed line across; none where None.
        logarithmic: Whether numbers of the axis are; where None, if they reach far.
    """
    places = list(dict.fromkeys(band.at for line in lines for band in line.bands))
    along = _axis_positions(places, logarithmic)
    limits = [] if limit is None else [limit]
    values = [value for line in lines for band in line.bands for value in (band.low, band.high) if value is not None]
    up = fitted_scale([*values, *limits] or [1.0], HEIGHT - _BOTTOM, _TOP)
    parts = horizontal_rules(up, _LEFT, WIDTH - _RIGHT)
    column = (WIDTH - _LEFT - _RIGHT) / len(places)
    characters = _NUMBER if _is_by_size(places) else int(column / _CHARACTER)
    labelled, line_count = -math.inf, 1
    for place in sorted(places, key=along.__getitem__):
        label = f"{place:g}" if isinstance(place, float) else str(place)
        if along[place] - labelled < _LABEL:
            continue
        labelled = along[place]
        line_count = max(line_count, len(label_lines(label, characters)))
        parts.append(element("path", class_="rule", d=f"M{labelled:.1f} {_TOP}V{HEIGHT - _BOTTOM}"))
        parts.append(wrapped_label(label, characters, (labelled, HEIGHT - _BOTTOM + 18), "middle"))
    parts += [_line(k, line, along, up, (axis, unit)) for k, line in enumerate(lines)]
    parts += [element("path", class_="level", d=f"M{_LEFT} {up.position(at):.1f}H{WIDTH - _RIGHT}") for at in limits]
    svg = drawing(WIDTH, HEIGHT + (line_count - 1) * _LINE, f"{title} over {axis}", *parts)
    caption = f"{axis} across, errors [{unit}] upwards: the median, and the band from 5 % to 95 % of the trials."
    return Figure(title, svg, caption)


def _axis_positions(places: Sequence[float | str], logarithmic: bool | None) -> dict[float | str, float]:
    """Where each value of the axis stands: by its size where all are numbers, else one after the other."""
    start, end = _LEFT, WIDTH - _RIGHT
    if _is_by_size(places):
        numbers = [float(place) for place in places]
        scale = fitted_scale(numbers, start, end, logarithmic)
        return {place: scale.position(number) for place, number in zip(places, numbers, strict=True)}
    return {place: start + (k + 0.5) * (end - start) / len(places) for k, place in enumerate(places)}


def _is_by_size(places: Sequence[float | str]) -> bool:
    return all(isinstance(place, int | float) and not isinstance(place, bool) for place in places)


def _line(number: int, line: Line, positions: dict[float | str, float], scale: Scale, names: tuple[str, str]) -> str:
    """A line and its band; broken where there is no answer."""
    axis, unit = names
    parts: list[str] = []
    # Bands with answers that are next to one another.
    for has_answer, bands in groupby(line.bands, lambda band: band.middle is not None):
        run = [
            (positions[b.at], *(scale.position(y) for y in (b.low, b.middle, b.high) if y is not None)) for b in bands
        ]
        if not has_answer:
            continue
        edge, middle = ([f"{each[0]:.1f} {each[k]:.1f}" for each in run] for k in (3, 2))
        back = [f"{x:.1f} {low:.1f}" for x, low, _, _ in reversed(run)]
        parts.append(element("path", class_="band", d=f"M{'L'.join([*edge, *back])}Z"))
        parts.append(element("path", class_="median", d=f"M{'L'.join(middle)}"))
        parts += [element("path", class_="whisker", d=f"M{x:.1f} {low:.1f}V{high:.1f}") for x, low, _, high in run]
    for band in line.bands:
        if band.middle is not None:
            title = element("title", text(f"{axis} {band.at}: {two_digits(band.middle)} {unit}"))
            place = {"cx": f"{positions[band.at]:.1f}", "cy": f"{scale.position(band.middle):.1f}"}
            parts.append(element("circle", title, **place, r=3.5))
    return element("g", element("title", text(line.name)), *parts, class_=f"line-{number % COLOURS}")
