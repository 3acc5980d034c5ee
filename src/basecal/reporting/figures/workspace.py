"""The expected error over the workspace that robots share, one drawing a height."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from basecal.cell import ErrorMap
from basecal.geometry import Array
from basecal.reporting.figures.figure import Figure
from basecal.reporting.figures.image_grid import FAINTEST
from basecal.reporting.svg import drawing, element, text

_TILE = 40.0  # of a point on the drawing, along each edge
_GAP = 2.0


def workspace(error_map: ErrorMap) -> Iterator[Figure]:
    """Of each height, from the lowest: squares shaded by the error, x to the right and y upwards."""
    low, high = error_map.length_95_m.min() * 1e3, error_map.length_95_m.max() * 1e3
    worst = int(error_map.length_95_m.argmax())
    across, along = np.unique(error_map.points_m[:, 0]), np.unique(error_map.points_m[:, 1])
    for height in np.unique(error_map.points_m[:, 2]):
        here = np.flatnonzero(error_map.points_m[:, 2] == height)
        tiles = [_tile(error_map, int(k), across, along, high, k == worst) for k in here]
        size = _TILE * len(across), _TILE * len(along)
        frame = element("rect", class_="frame", width=f"{size[0]:g}", height=f"{size[1]:g}")
        title = f"at z = {height:.3f} m"
        svg = drawing(*size, f"expected error {title}", frame, *tiles)
        of = error_map.length_95_m[here] * 1e3
        caption = f"95 % of errors below {of.min():.2g} to {of.max():.2g} mm here, {low:.2g} to {high:.2g} mm in all."
        if worst in here:
            caption += f" Outlined: the worst place, {', '.join(f'{x:.2f}' for x in error_map.points_m[worst])} m."
        yield Figure(title, svg, caption, _ends(across, "x"), _ends(along[::-1], "y"))


def _ends(values: Array, axis: str) -> tuple[str, ...]:
    if len(values) == 1:
        return (f"{axis} {values[0]:.2f} m",)
    return f"{axis} {values[0]:.2f} m", f"{values[-1]:.2f} m"


def _tile(error_map: ErrorMap, number: int, xs: Array, ys: Array, highest_mm: float, is_worst: bool) -> str:
    """The square of a point with its error in mm, the darker the larger; pointed at it says all."""
    x, y, z = error_map.points_m[number]
    mm, degrees = 1e3 * error_map.length_95_m[number], float(np.degrees(error_map.angle_95_rad[number]))
    label = f"({x:.3f}, {y:.3f}, {z:.3f}) m: {mm:.3g} mm and {degrees:.2g} deg"
    column, row = np.searchsorted(xs, x), len(ys) - 1 - np.searchsorted(ys, y)
    share = mm / highest_mm if highest_mm > 0 else 0.0
    square = element(
        "rect",
        class_="tile worst" if is_worst else "tile",
        x=f"{_TILE * column + _GAP / 2:g}",
        y=f"{_TILE * row + _GAP / 2:g}",
        width=f"{_TILE - _GAP:g}",
        height=f"{_TILE - _GAP:g}",
        fill_opacity=f"{FAINTEST + (1 - FAINTEST) * share:.2f}",
    )
    at = {"x": f"{_TILE * (column + 0.5):g}", "y": f"{_TILE * (row + 0.5) + 4:g}", "text_anchor": "middle"}
    return element(
        "g", element("title", text(label)), square, element("text", text(f"{mm:.2g}"), class_="tile-number", **at)
    )
