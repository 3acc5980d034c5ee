"""Heat maps: a number for each pair of values of two axes, darker if larger."""

from __future__ import annotations

import math
from collections.abc import Sequence

from markupsafe import Markup

from basecal.fields.digits import two_digits
from basecal.reporting.charts import value_text
from basecal.reporting.svg import Figure, drawing, label_lines, rectangle, tile, wrapped_label

_TILE_WIDTH, _TILE_HEIGHT = 84.0, 34.0
_LEFT, _TOP, _EDGE = 210.0, 12.0, 26.0
_CHARACTER, _LINE = 7.6, 14.0  # width of a character and height of a line of labels
_ROW_CHARACTERS, _COLUMN_CHARACTERS = int((_LEFT - 8) / _CHARACTER), int(_TILE_WIDTH / _CHARACTER)
_ROW_LINES = 2  # lines of a label in the height of a tile
_STRONGEST = 0.8  # shade of the largest number, on which text remains readable


def heat_map(
    title: str,
    columns: tuple[str, Sequence[object]],
    rows: tuple[str, Sequence[object]],
    values: Sequence[Sequence[float | None]],
) -> Figure:
    """Numbers on tiles, shaded by their logarithm.

    Args:
        title: Title of the figure.
        columns: Name and values of the horizontal axis.
        rows: Name and values of the vertical axis.
        values: Numbers by row and column; None if there is no result.
    """
    logs = [math.log10(value) for row in values for value in row if value is not None and value > 0]
    shades = (min(logs), max(logs)) if logs else (0.0, 0.0)
    parts, line_count = list[Markup](), 1
    for k, (axis_value, row) in enumerate(zip(rows[1], values, strict=True)):
        y, name = _TOP + k * _TILE_HEIGHT, value_text(axis_value)
        for i, value in enumerate(row):
            parts += _tile(_LEFT + i * _TILE_WIDTH, y, value, shades)
        lines = label_lines(name, _ROW_CHARACTERS, _ROW_LINES)
        raised = 0.5 * _LINE * (len(lines) - 1)
        parts.append(wrapped_label(name, lines, (_LEFT - 8, y + 0.6 * _TILE_HEIGHT - raised), "end"))
    bottom, width = _TOP + len(rows[1]) * _TILE_HEIGHT, len(columns[1]) * _TILE_WIDTH
    for i, axis_value in enumerate(columns[1]):
        name = value_text(axis_value)
        lines = label_lines(name, _COLUMN_CHARACTERS)
        line_count = max(line_count, len(lines))
        parts.append(wrapped_label(name, lines, (_LEFT + (i + 0.5) * _TILE_WIDTH, bottom + 17), "middle"))
    svg = drawing(_LEFT + width + 8, bottom + _EDGE + _LINE * (line_count - 1), title, *parts)
    return Figure(title, svg, f"{columns[0]} across, {rows[0]} downwards; median error of the trials [mm].")


def _tile(x: float, y: float, value: float | None, shades: tuple[float, float]) -> tuple[Markup, Markup]:
    low, high = shades
    box = (x, y, _TILE_WIDTH, _TILE_HEIGHT)
    number = "-" if value is None else two_digits(value)
    shown = wrapped_label(number, [number], (x + 0.5 * _TILE_WIDTH, y + 0.6 * _TILE_HEIGHT), "middle")
    if value is None or value <= 0:
        return rectangle("frame", box), shown
    share = (math.log10(value) - low) / (high - low) if high > low else 0.0
    return tile(box, _STRONGEST * share), shown
