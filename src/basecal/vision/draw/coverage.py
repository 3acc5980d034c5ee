"""How much of each pixel closed outlines cover: exact for straight edges, without sampling.

Every edge is cut at the borders of pixels. A piece adds its height to all pixels right of it, and to its own pixel the
part right of it. A running sum along rows then gives the covered area. What adjoining outlines share cancels.
Source: the accumulation buffer of R. Levien, "font-rs", written for arrays.
"""

from __future__ import annotations

import numpy as np

from basecal.geometry import Array


def coverage(outlines: Array, size_px: tuple[int, int]) -> Array:
    """Area of each pixel inside closed outlines that do not overlap, (h, w), in [0, 1].

    Args:
        outlines: (m, 2, 2) edges, start and end in pixels; the centre of the top-left pixel is (0, 0). Together they
            are closed, and clockwise on the screen.
        size_px: Width and height.
    """
    width, height = size_px
    edges = outlines + 0.5
    inside = (edges[..., 1].max(-1) > 0) & (edges[..., 1].min(-1) < height) & (edges[..., 0].min(-1) < width)
    pieces = _cut(_cut(edges[inside], axis=1), axis=0)
    middle = pieces.mean(axis=1)
    row = np.floor(middle[:, 1]).astype(np.int64)
    seen = (row >= 0) & (row < height) & (middle[:, 0] < width)
    x, row, rise = np.maximum(middle[seen, 0], 0.0), row[seen], (pieces[:, 1, 1] - pieces[:, 0, 1])[seen]
    column = np.floor(x).astype(np.int64)
    right = rise * (x - column)
    at = row * (width + 1) + column
    total = np.bincount(at, rise - right, height * (width + 1)) + np.bincount(at + 1, right, height * (width + 1))
    return -np.cumsum(total.reshape(height, width + 1)[:, :width], axis=1)


def _cut(edges: Array, axis: int) -> Array:
    """Edges cut wherever the coordinate `axis` is a whole number, (n, 2, 2)."""
    low, high = np.sort(edges[:, :, axis], axis=1).T
    first = np.floor(low)
    count = np.maximum(np.ceil(high) - first, 1).astype(np.int64)
    which = np.repeat(np.arange(len(edges)), count)
    step = np.arange(len(which)) - np.repeat(np.cumsum(count) - count, count)
    start, end = edges[which, 0], edges[which, 1]
    rising = end[:, axis] >= start[:, axis]
    # Pieces are counted from the low end; a falling edge gives them in reverse.
    floor, top = low[which], high[which]
    below = np.clip(first[which] + step, floor, top)
    above = np.clip(first[which] + step + 1, floor, top)
    length = np.where(top > floor, top - floor, 1.0)
    enter, leave = (np.where(rising, below, above), np.where(rising, above, below))
    origin = start[:, axis]
    sense = np.where(rising, 1.0, -1.0) / length
    near, far = ((enter - origin) * sense)[:, None], ((leave - origin) * sense)[:, None]
    flat = (top == floor)[:, None]
    pieces = np.stack([start + near * (end - start), start + np.where(flat, 1.0, far) * (end - start)], axis=1)
    pieces[:, 0, axis], pieces[:, 1, axis] = enter, leave
    return pieces
