"""Labelled contour lines over a grid."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from markupsafe import Markup
from numpy.lib.stride_tricks import sliding_window_view

from basecal.geometry import Array
from basecal.reporting.charts import fitted_scale
from basecal.reporting.svg import element, path, segments

_FINER = 8  # parts that each step of the grid is divided into
_HALVES = slice(None, -1), slice(1, None)
_LETTER = np.array([12.0, 22.0])  # largest width and height of a letter of a label, of the drawing


def contours(values: Array, pitch: float) -> list[Markup]:
    """Contour lines over a drawing of squares, from the values at their centres.

    Args:
        values: (rows, columns); there are lines only if all are finite, with at least two rows and two columns.
        pitch: Edge of a square.
    """
    if min(values.shape) < 2 or not np.ptp(values) > 0:
        return []
    fine = refine(refine(values).T).T
    lines, labels, boxes = "", list[Markup](), list[tuple[Array, Array]]()
    scale = fitted_scale(values.ravel().tolist(), 0.0, 1.0)
    for level in [tick for tick in scale.ticks() if values.min() < tick < values.max()]:
        ends = pitch * (level_segments(fine, level) / _FINER + 0.5)
        lines += segments(ends)
        middles = ends.mean(1)
        text = f"{level:.6g}"
        half = 0.5 * _LETTER * [len(text), 1]
        free = [middle for middle in middles if _is_apart(middle, half, boxes)]
        if free:
            x, y = centre = free[len(free) // 2]
            boxes.append((centre, half))
            labels.append(element("text", text, class_="contour-label", x=x, y=y + 4, text_anchor="middle"))
    return [path("contour", lines), *labels]


def _is_apart(point: Array, half: Array, boxes: Sequence[tuple[Array, Array]]) -> bool:
    """Whether a label at a point, with half its width and height, overlaps none of the other labels."""
    return all(np.any(np.abs(point - centre) > half + other) for centre, other in boxes)


def refine(values: Array) -> Array:
    """Interpolate rows `_FINER` times as dense, (n, columns) to ((n - 1) _FINER + 1, columns), by Catmull-Rom splines.

    Source: Catmull & Rom 1974. Values are extrapolated linearly beyond the ends.
    """
    t = np.arange(_FINER) / _FINER
    weights = 0.5 * np.stack([-t + 2 * t**2 - t**3, 2 - 5 * t**2 + 3 * t**3, t + 4 * t**2 - 3 * t**3, t**3 - t**2])
    longer = np.pad(values, ((1, 1), (0, 0)), mode="reflect", reflect_type="odd")
    fine = (sliding_window_view(longer, 4, axis=0) @ weights).swapaxes(1, 2)
    return np.concatenate([fine.reshape(-1, values.shape[1]), values[-1:]])


def level_segments(values: Array, level: float) -> Array:
    """Segments on which values, linear within triangles of a grid, equal a level: (n, 2, 2), column and row of ends."""
    rows, columns = np.indices(values.shape)
    nodes = np.stack([columns, rows, values - level], axis=-1)
    a, b, c, d = (nodes[rows, columns].reshape(-1, 3) for rows in _HALVES for columns in _HALVES)
    corners = np.concatenate([np.stack([a, b, c], axis=1), np.stack([d, c, b], axis=1)])
    ends = np.roll(corners, -1, axis=1)
    crossed = (corners[..., 2] >= 0) != (ends[..., 2] >= 0)  # of a triangle no edge, or two
    start, along = corners[crossed], (ends - corners)[crossed]
    crossings: Array = start - start[:, 2:] / along[:, 2:] * along
    return crossings[:, :2].reshape(-1, 2, 2)
