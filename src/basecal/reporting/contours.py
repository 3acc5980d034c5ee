"""Lines of equal value over a grid, each with its value."""

from __future__ import annotations

import numpy as np
from markupsafe import Markup

from basecal.geometry import Array
from basecal.reporting.charts import fitted_scale
from basecal.reporting.svg import element, path, segments

_FINER = 8  # parts that each step of the grid is divided into
_HALVES = slice(None, -1), slice(1, None)
_LABEL_DISTANCE = 34.0  # of the drawing, between two labels


def contours(values: Array, pitch: float) -> list[Markup]:
    """Lines over a drawing whose squares of edge `pitch` have these values in their middles.

    Args:
        values: (rows, columns); there are no lines unless all are finite, and at least two each.
        pitch: Edge of a square.
    """
    if min(values.shape) < 2 or not np.ptp(values) > 0:
        return []
    from scipy.ndimage import zoom  # takes longer to load than a page without contours to make

    fine = zoom(values, _FINER, order=min(3, min(values.shape) - 1))
    pitches = pitch * np.divide(np.array(values.shape) - 1, np.array(fine.shape) - 1)[::-1]
    lines, labels, places = "", list[Markup](), list[Array]()
    scale = fitted_scale(values.ravel().tolist(), 0.0, 1.0)
    for level in [tick for tick in scale.ticks() if values.min() < tick < values.max()]:
        found = level_segments(fine, level) * pitches + 0.5 * pitch
        lines += segments(found)
        middles = found.mean(1)
        free = [at for at in middles if all(np.linalg.norm(at - other) > _LABEL_DISTANCE for other in places)]
        if free:
            x, y = place = free[len(free) // 2]
            places.append(place)
            labels.append(element("text", f"{level:.6g}", class_="contour-label", x=x, y=y + 4, text_anchor="middle"))
    return [path("contour", lines), *labels]


def level_segments(values: Array, level: float) -> Array:
    """Where values that are linear within triangles of a grid reach a level: (n, 2, 2), column and row of both ends."""
    rows, columns = np.indices(values.shape)
    every = np.stack([columns, rows, values - level], axis=-1)
    a, b, c, d = (every[rows, columns].reshape(-1, 3) for rows in _HALVES for columns in _HALVES)
    corners = np.concatenate([np.stack([a, b, c], axis=1), np.stack([d, c, b], axis=1)])
    ends = np.roll(corners, -1, axis=1)
    crossed = (corners[..., 2] >= 0) != (ends[..., 2] >= 0)  # of a triangle no edge, or two
    start, along = corners[crossed], (ends - corners)[crossed]
    met: Array = start - start[:, 2:] / along[:, 2:] * along
    return met[:, :2].reshape(-1, 2, 2)
