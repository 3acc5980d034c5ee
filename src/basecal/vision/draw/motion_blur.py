"""Motion blur: levels averaged along a line."""

from __future__ import annotations

import cv2
import numpy as np

from basecal.geometry import Array

_INVISIBLE_PX = 0.02  # length of a blur: a tenth of the detectors' resolution
_LONGEST_PX = 400.0  # length of a blur, above which nothing remains visible


def blur_motion(levels: Array, motion_px: Array) -> Array:
    """Average levels, (h, w), along the motion of the image content during the exposure, `motion_px`, (2,) [px]."""
    length = float(np.linalg.norm(motion_px))
    if length < _INVISIBLE_PX:
        return levels
    u, v = np.asarray(motion_px) * min(1.0, _LONGEST_PX / length)
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
