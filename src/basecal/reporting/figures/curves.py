"""Curves over an axis of a study, with bands."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import groupby
from typing import NamedTuple

from markupsafe import Markup

from basecal.fields.digits import two_digits
from basecal.reporting.charts import Scale, fitted_scale, horizontal_rules, value_text
from basecal.reporting.svg import drawing, element, label_lines, path, wrapped_label

WIDTH, HEIGHT = 640.0, 290.0
"""Size of a drawing with labels of one line."""
_LEFT, _RIGHT, _TOP, _BOTTOM = 62.0, 14.0, 12.0, 42.0
_CHARACTER, _LINE = 11.5, 22.0  # width of a character and height of a line of labels on a narrow screen
_NUMBER = 12  # largest number of characters of a number
_LABEL = 36.0  # smallest distance between labels of the axis
COLOURS = 6
"""Largest number of lines with distinct colours."""


class Band(NamedTuple):
    """Value of the axis, with the low end of the band, the median and the high end; None if there is no result."""

    axis_value: float | str
    errors: tuple[float, float, float] | None


Lines = Mapping[str, Sequence[Band]]
"""Lines by name."""


def curves(
    title: str, axis: str, unit: str, lines: Lines, limit: float | None = None, logarithmic: bool | None = None
) -> Markup:
    """A drawing of curves of medians over an axis, with their bands; at most `COLOURS` lines.

    Args:
        title: Name of the quantity.
        axis: Name of the axis.
        unit: Unit of the errors.
        lines: Bands of each line, in the order of the axis.
        limit: Value of a dashed horizontal line; None for no line.
        logarithmic: Whether the axis is logarithmic; if None, it is for a wide range of values.
    """
    along, characters = _axis_positions([band.axis_value for bands in lines.values() for band in bands], logarithmic)
    limits = [] if limit is None else [limit]
    values = [value for bands in lines.values() for band in bands for value in band.errors or ()]
    up = fitted_scale([*values, *limits] or [1.0], HEIGHT - _BOTTOM, _TOP)
    parts = horizontal_rules(up, _LEFT, WIDTH - _RIGHT)
    last_label_x, line_count = -math.inf, 1
    for axis_value, x in sorted(along.items(), key=lambda each: each[1]):
        if x - last_label_x < _LABEL:
            continue
        last_label_x, label = x, value_text(axis_value)
        words = label_lines(label, characters)
        line_count = max(line_count, len(words))
        parts.append(path("rule", f"M{x:.1f} {_TOP}V{HEIGHT - _BOTTOM}"))
        parts.append(wrapped_label(label, words, (x, HEIGHT - _BOTTOM + 18), "middle"))
    for number, (name, bands) in enumerate(lines.items()):
        line = _line(bands, along, up, f"{axis} {{}}: {{}} {unit}")
        parts.append(element("g", *line, title=name, class_=f"line-{number % COLOURS}"))
    parts += [path("level", f"M{_LEFT} {up.position(value):.1f}H{WIDTH - _RIGHT}") for value in limits]
    return drawing(WIDTH, HEIGHT + (line_count - 1) * _LINE, f"{title} over {axis}", *parts)


def _axis_positions(values: Sequence[float | str], logarithmic: bool | None) -> tuple[dict[float | str, float], int]:
    """Position of each value of the axis, and the number of characters per line of labels.

    Numbers are placed on a scale; other values are placed at equal distances.
    """
    distinct_values = list(dict.fromkeys(values))
    numbers = [each for each in distinct_values if isinstance(each, int | float) and not isinstance(each, bool)]
    if len(numbers) == len(distinct_values):
        scale = fitted_scale(numbers, _LEFT, WIDTH - _RIGHT, logarithmic)
        return {number: scale.position(number) for number in numbers}, _NUMBER
    column = (WIDTH - _LEFT - _RIGHT) / len(distinct_values)
    return {value: _LEFT + (k + 0.5) * column for k, value in enumerate(distinct_values)}, int(column / _CHARACTER)


def _line(bands: Sequence[Band], positions: Mapping[float | str, float], scale: Scale, label: str) -> list[Markup]:
    """A line and its band, interrupted at values without a result."""
    parts: list[Markup] = []
    # Runs of consecutive bands with results.
    for _, group in groupby(bands, lambda band: band.errors is None):
        run = [
            (positions[x_value], [*map(scale.position, errors)], label.format(x_value, two_digits(errors[1])))
            for x_value, errors in group
            if errors
        ]
        if not run:
            continue
        low, middle, high = ([f"{x:.1f} {ys[k]:.1f}" for x, ys, _ in run] for k in range(3))
        parts += [path("band", f"M{'L'.join([*high, *reversed(low)])}Z"), path("median", f"M{'L'.join(middle)}")]
        for x, (bottom, y, top), title in run:
            parts.append(path("whisker", f"M{x:.1f} {bottom:.1f}V{top:.1f}"))
            parts.append(element("circle", title=title, cx=x, cy=y, r=3.5))
    return parts
