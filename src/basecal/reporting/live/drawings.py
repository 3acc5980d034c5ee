"""What the local page draws of a capture: coverage, sigma over samples, detections over a picture."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from basecal.acquisition.coverage import Coverage
from basecal.acquisition.watching import Sigma
from basecal.geometry import Array
from basecal.reporting.svg import drawing, element, text, three_digits

_TILE_PX = 20.0
_WIDTH, _HEIGHT, _LEFT, _BOTTOM = 360.0, 160.0, 56.0, 24.0
_SEEN_COLOUR, _OPEN_COLOUR, _LINE_COLOUR, _TEXT_COLOUR = "#2e8b57", "#d7dbe0", "#1f6fb2", "#555555"
_MARK_COLOUR = "#ff3b30"


def coverage_drawing(coverage: Coverage) -> str:
    """The picture's parts, those in which points were seen full."""
    rows, columns = coverage.cells.shape
    cells = (
        element(
            "rect",
            x=column * _TILE_PX + 1,
            y=row * _TILE_PX + 1,
            width=_TILE_PX - 2,
            height=_TILE_PX - 2,
            fill=_SEEN_COLOUR if coverage.cells[row, column] else _OPEN_COLOUR,
        )
        for row in range(rows)
        for column in range(columns)
    )
    label = f"{100 * coverage.share:.0f} % of the picture is covered"
    return drawing(columns * _TILE_PX, rows * _TILE_PX, label, *cells)


def sigma_drawing(sigmas: Sequence[Sigma]) -> str:
    """The base's sigma [mm] over samples, on a logarithmic axis; empty before there are two."""
    if len(sigmas) < 2:
        return ""
    samples = np.array([sigma.samples for sigma in sigmas], dtype=np.float64)
    mm = 1e3 * np.array([sigma.t_m for sigma in sigmas])
    x = _LEFT + (samples - samples[0]) / max(np.ptp(samples), 1.0) * (_WIDTH - _LEFT - 8)
    low, high = np.log(mm.min() / 1.1), np.log(mm.max() * 1.1)
    y = 8 + (high - np.log(mm)) / (high - low) * (_HEIGHT - _BOTTOM - 8)
    path = "M" + "L".join(f"{u:.1f} {v:.1f}" for u, v in zip(x, y, strict=True))
    places = [(0, float(y[0]) + 4), (0, float(y[-1]) + 4)]
    values = (three_digits(float(mm[0])), three_digits(float(mm[-1])))
    words = [
        element("text", text(f"{value} mm"), x=at[0], y=at[1], font_size=11, fill=_TEXT_COLOUR)
        for value, at in zip(values, places, strict=True)
    ]
    ends = [
        element(
            "text", text(f"{count:.0f}"), x=at, y=_HEIGHT - 6, font_size=11, fill=_TEXT_COLOUR, text_anchor="middle"
        )
        for count, at in ((samples[0], x[0]), (samples[-1], x[-1] - 4))
    ]
    line = element("path", d=path, fill="none", stroke=_LINE_COLOUR, stroke_width=2)
    return drawing(_WIDTH, _HEIGHT, "sigma of the base over samples", line, *words, *ends)


def marks(pixels: Array) -> str:
    """Crosses at points, (n, 2) [px], to lay over a picture."""
    size = 5.0
    path = "".join(f"M{u - size:.1f} {v:.1f}h{2 * size}M{u:.1f} {v - size:.1f}v{2 * size}" for u, v in pixels)
    return element("path", d=path, fill="none", stroke=_MARK_COLOUR, stroke_width=1.5) if path else ""
