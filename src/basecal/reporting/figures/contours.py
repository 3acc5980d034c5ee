"""Lines of equal value over a grid, each with its value."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import zoom

from basecal.geometry import Array
from basecal.reporting.charts import fitted_scale
from basecal.reporting.svg import element, segments, text

_FINER = 8  # parts that each step of the grid is divided into
_HALVES = slice(None, -1), slice(1, None)
_LABEL_DISTANCE = 34.0  # of the drawing, between two labels


def contours(values: Array, pitch: float) -> list[str]:
    """Lines over a drawing whose squares of edge `pitch` have these values in their middles.

    Args:
        values: (rows, columns), finite; at least two each.
        pitch: Edge of a square.
    """
    if min(values.shape) < 2 or not np.ptp(values) > 0:
        return []
    fine = zoom(values, _FINER, order=min(3, min(values.shape) - 1))
    pitches = pitch * (np.array(values.shape[::-1]) - 1) / (np.array(fine.shape[::-1]) - 1)
    lines, labels, places = [], list[str](), list[Array]()
    scale = fitted_scale(values.ravel().tolist(), 0.0, 1.0)
    for level in [tick for tick in scale.ticks() if values.min() < tick < values.max()]:
        found = level_segments(fine, level) * pitches + 0.5 * pitch
        lines.append(segments(found))
        middles = found.mean(1)
        free = [at for at in middles if all(np.linalg.norm(at - other) > _LABEL_DISTANCE for other in places)]
        if free:
            places.append(free[len(free) // 2])
            at = {"x": f"{places[-1][0]:.1f}", "y": f"{places[-1][1] + 4:.1f}", "text_anchor": "middle"}
            labels.append(element("text", text(f"{level:.6g}"), class_="contour-label", **at))
    return [element("path", class_="contour", d="".join(lines)), *labels]


def level_segments(values: Array, level: float) -> Array:
    """Where values that are linear within triangles of a grid reach a level: (n, 2, 2), column and row of both ends."""
    rows, columns = (np.arange(count) for count in values.shape)
    at = np.stack(np.meshgrid(columns, rows), -1).astype(np.float64)
    every = np.concatenate([at, values[..., None]], axis=-1)
    a, b, c, d = (every[rows][:, columns].reshape(-1, 3) for rows in _HALVES for columns in _HALVES)
    triangles = np.concatenate([np.stack([a, b, c], axis=1), np.stack([d, c, b], axis=1)])
    corners, heights = triangles[..., :2], triangles[..., 2]
    ends, other = np.roll(corners, -1, axis=1), np.roll(heights, -1, axis=1)
    crossed = (heights >= level) != (other >= level)  # of a triangle no edge, or two
    share = ((level - heights)[crossed] / (other - heights)[crossed])[:, None]
    met: Array = corners[crossed] + share * (ends - corners)[crossed]
    return met.reshape(-1, 2, 2)
