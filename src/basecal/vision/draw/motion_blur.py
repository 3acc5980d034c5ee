"""Images taken while something moves: levels smeared along a line."""

from __future__ import annotations

import cv2
import numpy as np

from basecal.geometry import Array

_INVISIBLE_PX = 0.02  # of a smear: a tenth of what detectors tell apart
_LONGEST_PX = 400.0  # what moves further within an exposure is gone


def blur_motion(levels: Array, way_px: Array) -> Array:
    """Levels (h, w) averaged along a way (2,) [px] that everything in them moves while the shutter is open."""
    length = float(np.linalg.norm(way_px))
    if length < _INVISIBLE_PX:
        return levels
    u, v = np.asarray(way_px) * min(1.0, _LONGEST_PX / length)
    half = int(np.ceil(max(abs(u), abs(v)) / 2)) + 1
    kernel = np.zeros((2 * half + 1, 2 * half + 1))
    steps = 4 * half + 1
    for at in (np.arange(steps) + 0.5) / steps - 0.5:
        x, y = half + at * u, half + at * v
        column, row = int(np.floor(x)), int(np.floor(y))
        right, down = x - column, y - row
        shares = np.outer([1 - down, down], [1 - right, right])
        kernel[row : row + 2, column : column + 2] += shares / steps
    return np.asarray(cv2.filter2D(levels, -1, kernel, borderType=cv2.BORDER_REPLICATE))
