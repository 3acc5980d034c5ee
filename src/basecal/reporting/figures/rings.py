"""Rings of a polar plot, and where things stand on it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from basecal.geometry import Array
from basecal.reporting.svg import drawing, element, text

RADIUS = 150.0
_MARGIN_PX = 16.0
MIDDLE = RADIUS + _MARGIN_PX


def place_on_rings(xy: Array, top: float) -> Array:
    """Places on the drawing, (n, 2), of points whose length is `top` on the outermost ring; longer ones stand on it."""
    length = np.linalg.norm(xy, axis=-1, keepdims=True)
    shown: Array = MIDDLE + RADIUS * xy / np.maximum(length, top)
    return shown


def polar_drawing(label: str, rings: Sequence[tuple[float, str]], *inside: str) -> str:
    """A drawing of rings at shares of the radius, named beside them, with what is given on top."""
    circles = [
        element("circle", class_="ring", cx=f"{MIDDLE:g}", cy=f"{MIDDLE:g}", r=f"{share * RADIUS:.1f}")
        for share, _ in rings
    ]
    ends = f"M{MIDDLE - RADIUS:g} {MIDDLE:g}h{2 * RADIUS:g}M{MIDDLE:g} {MIDDLE - RADIUS:g}v{2 * RADIUS:g}"
    cross = element("path", class_="ring", d=ends)
    named = [
        element("text", text(name), class_="ring-label", x=f"{MIDDLE + 3:g}", y=f"{MIDDLE - share * RADIUS - 3:.1f}")
        for share, name in rings
    ]
    return drawing(2 * MIDDLE, 2 * MIDDLE, label, *circles, cross, *inside, *named)
