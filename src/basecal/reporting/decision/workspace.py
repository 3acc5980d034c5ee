"""The expected error over the workspace that robots share, one drawing a height."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from basecal.cell import ErrorMap
from basecal.geometry import Array
from basecal.reporting.figures.contours import contours
from basecal.reporting.figures.figure import Figure, rectangle, tile
from basecal.reporting.statement.digits import two_digits
from basecal.reporting.svg import drawing

_TILE = 40.0  # of a point on the drawing, along each edge


def workspace(error_map: ErrorMap) -> Iterator[Figure]:
    """Contours of the error at each height, from the lowest, x to the right and y upwards."""
    lengths_mm = 1e3 * error_map.length_95_m
    low, high = float(lengths_mm.min()), float(lengths_mm.max())
    across, along = np.unique(error_map.points_m[:, 0]), np.unique(error_map.points_m[:, 1])
    for height in np.unique(error_map.points_m[:, 2]):
        here = np.flatnonzero(error_map.points_m[:, 2] == height)
        grid = here[np.lexsort((error_map.points_m[here, 0], -error_map.points_m[here, 1]))]
        shares = (lengths_mm - low) / max(high - low, 1e-12)
        tiles = [_tile(error_map, int(k), across, along, float(shares[k])) for k in grid]
        size = _TILE * len(across), _TILE * len(along)
        is_whole = len(grid) == len(across) * len(along)
        lines = contours(lengths_mm[grid].reshape(len(along), -1), _TILE) if is_whole else []
        title = f"at z = {height:.3f} m"
        svg = drawing(*size, f"expected error {title}", rectangle("frame", (0, 0, *size)), *tiles, *lines)
        ends = (two_digits(float(end)) for end in (lengths_mm[here].min(), lengths_mm[here].max(), low, high))
        caption = "95 % of errors below {} to {} mm here, {} to {} mm in all.".format(*ends)
        if error_map.worst in here:
            place = ", ".join(f"{x:.2f}" for x in error_map.points_m[error_map.worst])
            caption += f" Outlined: the worst place, {place} m."
        yield Figure(title, svg, caption, _ends(across, "x"), _ends(along[::-1], "y"))


def _ends(values: Array, axis: str) -> tuple[str, ...]:
    if len(values) == 1:
        return (f"{axis} {values[0]:.2f} m",)
    return f"{axis} {values[0]:.2f} m", f"{values[-1]:.2f} m"


def _tile(error_map: ErrorMap, number: int, xs: Array, ys: Array, share: float) -> str:
    """The square of a point, the darker the larger its error; pointed at it says all."""
    x, y, z = error_map.points_m[number]
    mm, degrees = 1e3 * error_map.length_95_m[number], float(np.degrees(error_map.angle_95_rad[number]))
    label = f"({x:.3f}, {y:.3f}, {z:.3f}) m: {two_digits(mm)} mm and {two_digits(degrees)} deg"
    column, row = np.searchsorted(xs, x), len(ys) - 1 - np.searchsorted(ys, y)
    kind = "tile worst" if number == error_map.worst else "tile"
    return tile((_TILE * column, _TILE * row, _TILE, _TILE), share, label, kind)
