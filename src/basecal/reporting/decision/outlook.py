"""Figures of the expected error: over the number of samples, by axis, and over the workspace."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from basecal.cell import ErrorMap
from basecal.fields.digits import two_digits
from basecal.geometry import Array, PoseEstimate
from basecal.reporting.contours import contours
from basecal.reporting.figures.curves import Band, curves
from basecal.reporting.statement.verdict import error_text
from basecal.reporting.svg import Figure, drawing, element, path, rectangle, tile

_WIDTH, _ROW, _LEFT, _RIGHT = 420.0, 30.0, 24.0, 100.0
_INTERVAL_SIGMAS = 1.96  # half width of the interval of 95 % of normal errors
_TILE = 40.0  # edge of a point's tile on the drawing
_POINT_TEXT = "({:.3f}, {:.3f}, {:.3f}) m: {}"  # text for a point


def outlook_figure(outlook: Sequence[tuple[int, float]], recorded_count: int, tolerance_m: float | None) -> Figure:
    """Curve of the expected error over recorded and additional planned samples, (additional count, error [m]) each."""
    points = [(recorded_count + count, length) for count, length in outlook]
    return error_curve("expected error at the task, 95 %, with more samples", points, tolerance_m)


def error_curve(title: str, points: Sequence[tuple[int, float]], tolerance_m: float | None) -> Figure:
    """Curve of an error over the number of samples, (count, error [m]) each, with the tolerance."""
    limit = None if tolerance_m is None else 1e3 * tolerance_m
    bands = [Band(count, (1e3 * length,) * 3) for count, length in points]
    svg = curves(title, "samples", "mm", {title: bands}, limit, logarithmic=False)
    also = "" if limit is None else f" Dashed: the tolerance, {limit:g} mm."
    ends_text = ", ".join(f"{two_digits(1e3 * length)} mm with {count}" for count, length in (points[0], *points[-1:]))
    return Figure(f"{title} [mm]", svg, f"{ends_text} samples.{also}")


def component_figure(name: str, estimate: PoseEstimate, tolerance_m: float | None) -> Figure:
    """Intervals of the errors along x, y and z, over the band of the tolerance if one is stated."""
    lengths = 1e3 * _INTERVAL_SIGMAS * estimate.sigma_t
    limit = None if tolerance_m is None else 1e3 * tolerance_m
    most = 1.1 * max(float(lengths.max()), limit or 0.0, 1e-9)
    middle, half = (_LEFT + _WIDTH - _RIGHT) / 2, (_WIDTH - _RIGHT - _LEFT) / 2
    height = 3 * _ROW
    allowed = half * (limit or 0.0) / most
    parts = [] if limit is None else [rectangle("allowed", (middle - allowed, 0, 2 * allowed, height))]
    parts.append(path("rule", f"M{middle:.1f} 0V{height:g}"))
    for row, (axis, length) in enumerate(zip("xyz", lengths, strict=True)):
        y, reach = _ROW * (row + 0.5), half * length / most
        kind = "beyond" if limit is not None and length > limit else "within"
        parts.append(path(f"interval {kind}", f"M{middle - reach:.1f} {y - 6}v12m0-6H{middle + reach:.1f}m0-6v12"))
        for x, words in ((6, axis), (_WIDTH - _RIGHT + 12, f"± {two_digits(length)} mm")):
            parts.append(element("text", words, x=x, y=y + 4, class_="tick"))
    also = "" if limit is None else f" Shaded: the tolerance, {limit:g} mm."
    caption = f"Intervals that hold 95 % of errors along each axis of {name.partition('_from_')[2]}.{also}"
    svg = drawing(_WIDTH, height, "95 % intervals by axis", *parts)
    return Figure("position by axis, 95 % intervals", svg, caption)


def workspace(error_map: ErrorMap) -> Iterator[Figure]:
    """Contours of the error at each height, from the lowest, x to the right and y upwards."""
    lengths_mm, points = 1e3 * error_map.length_95_m, error_map.points_m
    low, high = float(lengths_mm.min()), float(lengths_mm.max())
    shares = (lengths_mm - low) / max(high - low, 1e-12)
    across, upwards, heights = (np.unique(axis) for axis in points.T)
    size = _TILE * len(across), _TILE * len(upwards)
    columns, rows = np.searchsorted(across, points[:, 0]), np.searchsorted(-upwards[::-1], -points[:, 1])
    for height in heights:
        indices = np.flatnonzero(points[:, 2] == height).tolist()
        values = np.full((len(upwards), len(across)), np.nan)
        values[rows[indices], columns[indices]] = lengths_mm[indices]
        tiles = [
            tile(
                (_TILE * columns[k], _TILE * rows[k], _TILE, _TILE),
                shares[k],
                _POINT_TEXT.format(*points[k], error_text(error_map.length_95_m[k], error_map.angle_95_rad[k])),
                "tile worst" if k == error_map.worst else "tile",
            )
            for k in indices
        ]
        title = f"at z = {height:.3f} m"
        frame = rectangle("frame", (0, 0, *size))
        svg = drawing(*size, f"expected error {title}", frame, *tiles, *contours(values, _TILE))
        ends = map(two_digits, (lengths_mm[indices].min(), lengths_mm[indices].max(), low, high))
        caption = (
            "95 % of errors stay below {} to {} mm at this height, and below {} to {} mm in the whole map.".format(
                *ends
            )
        )
        if error_map.worst in indices:
            place = ", ".join(f"{x:.2f}" for x in points[error_map.worst])
            caption += f" Outlined: the worst place, {place} m."
        yield Figure(title, svg, caption, _ends(across, "x"), _ends(upwards[::-1], "y"))


def _ends(values: Array, axis: str) -> tuple[str, ...]:
    return f"{axis} {values[0]:.2f} m", *(f"{value:.2f} m" for value in values[1:][-1:])
