"""How wide edges are in a picture, in any direction: what a blur by motion or focus does."""

from __future__ import annotations

import cv2
import numpy as np

from basecal.geometry import Array
from basecal.vision.detection import Image

_DIRECTIONS = 8  # of edges that are looked at apart, over half a turn: motion blurs those across it alone
_LEAST_SHARE = 0.04  # of all edges that a direction has to have, to count
_STRONG = 0.2  # of the strongest slopes: weaker ones are noise, or shading
_BORDER_PX = 10  # about the points


def edge_width(image: Image, pixels: Array) -> float | None:
    """The width of the widest edges about some points [px]: their contrast over their mean slope.

    An ideal edge through a point spread of sigma s has 3.5 s; None where there are no edges.

    Args:
        image: (h, w).
        pixels: (n, 2) points of a target, between which edges are looked at.
    """
    low = np.maximum(np.floor(pixels.min(0)).astype(int) - _BORDER_PX, 0)
    high = np.ceil(pixels.max(0)).astype(int) + _BORDER_PX + 1
    part = image[low[1] : high[1], low[0] : high[0]].astype(np.float32)
    if min(part.shape) < 3:
        return None
    u, v = (0.5 * cv2.Sobel(part, cv2.CV_32F, *which, ksize=1) for which in ((1, 0), (0, 1)))
    slope = np.hypot(u, v)
    strong = slope > _STRONG * np.quantile(slope, 0.999)
    direction = (np.arctan2(v, u)[strong] * _DIRECTIONS / np.pi).round().astype(int) % _DIRECTIONS
    lengths = np.bincount(direction, slope[strong], _DIRECTIONS)
    squares = np.bincount(direction, slope[strong].astype(np.float64) ** 2, _DIRECTIONS)
    counts = lengths > _LEAST_SHARE * lengths.sum()
    if not counts.any():
        return None
    contrast = float(np.quantile(part, 0.95) - np.quantile(part, 0.05))
    return contrast * float((lengths[counts] / squares[counts]).max())
