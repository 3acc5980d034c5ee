"""The expected error over the workspace that robots share, one drawing a height."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from basecal.cell import ErrorMap
from basecal.geometry import Array
from basecal.reporting.contours import contours
from basecal.reporting.figures.figure import Figure, rectangle, tile
from basecal.reporting.statement.digits import two_digits
from basecal.reporting.statement.verdict import error_text
from basecal.reporting.svg import drawing

_TILE = 40.0  # of a point on the drawing, along each edge
_WORDS = "({:.3f}, {:.3f}, {:.3f}) m: {}"  # of a point


def workspace(error_map: ErrorMap) -> Iterator[Figure]:
    """Contours of the error at each height, from the lowest, x to the right and y upwards."""
    lengths_mm, points = 1e3 * error_map.length_95_m, error_map.points_m
    low, high = float(lengths_mm.min()), float(lengths_mm.max())
    shares = (lengths_mm - low) / max(high - low, 1e-12)
    across, upwards, heights = (np.unique(axis) for axis in points.T)
    size = _TILE * len(across), _TILE * len(upwards)
    columns, rows = np.searchsorted(across, points[:, 0]), np.searchsorted(-upwards[::-1], -points[:, 1])
    for height in heights:
        here = np.flatnonzero(points[:, 2] == height).tolist()
        values = np.full((len(upwards), len(across)), np.nan)
        values[rows[here], columns[here]] = lengths_mm[here]
        tiles = [
            tile(
                (_TILE * columns[k], _TILE * rows[k], _TILE, _TILE),
                shares[k],
                _WORDS.format(*points[k], error_text(error_map.length_95_m[k], error_map.angle_95_rad[k])),
                "tile worst" if k == error_map.worst else "tile",
            )
            for k in here
        ]
        title = f"at z = {height:.3f} m"
        frame = rectangle("frame", (0, 0, *size))
        svg = drawing(*size, f"expected error {title}", frame, *tiles, *contours(values, _TILE))
        ends = map(two_digits, (lengths_mm[here].min(), lengths_mm[here].max(), low, high))
        caption = "95 % of errors below {} to {} mm here, {} to {} mm in all.".format(*ends)
        if error_map.worst in here:
            place = ", ".join(f"{x:.2f}" for x in points[error_map.worst])
            caption += f" Outlined: the worst place, {place} m."
        yield Figure(title, svg, caption, _ends(across, "x"), _ends(upwards[::-1], "y"))


def _ends(values: Array, axis: str) -> tuple[str, ...]:
    return f"{axis} {values[0]:.2f} m", *(f"{value:.2f} m" for value in values[1:][-1:])
