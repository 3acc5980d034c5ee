"""Rings of a polar plot, and where things stand on it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from markupsafe import Markup

from basecal.geometry import Array
from basecal.reporting.svg import drawing, element, path

RADIUS = 150.0
_MARGIN_PX = 16.0
MIDDLE = RADIUS + _MARGIN_PX


def place_on_rings(xy: Array, top: float) -> Array:
    """Places on the drawing, (n, 2), of points whose length is `top` on the outermost ring; longer ones stand on it."""
    length = np.linalg.norm(xy, axis=-1, keepdims=True)
    shown: Array = MIDDLE + RADIUS * xy / np.maximum(length, top)
    return shown


def ring(kind: str, radius: float) -> Markup:
    """A circle about the middle."""
    return element("circle", class_=kind, cx=MIDDLE, cy=MIDDLE, r=radius)


def polar_drawing(label: str, rings: Sequence[tuple[float, str]], *inside: str) -> Markup:
    """A drawing of rings at shares of the radius, named beside them, with what is given on top."""
    circles = [ring("ring", share * RADIUS) for share, _ in rings]
    ends = f"M{MIDDLE - RADIUS:g} {MIDDLE:g}h{2 * RADIUS:g}M{MIDDLE:g} {MIDDLE - RADIUS:g}v{2 * RADIUS:g}"
    named = [
        element("text", name, class_="ring-label", x=MIDDLE + 3, y=MIDDLE - share * RADIUS - 3) for share, name in rings
    ]
    return drawing(2 * MIDDLE, 2 * MIDDLE, label, *circles, path("ring", ends), *inside, *named)
