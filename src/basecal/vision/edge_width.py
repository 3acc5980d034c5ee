"""How wide edges are in an image, in any direction: what a blur by motion or focus does."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from basecal.geometry import Array
from basecal.vision.detection import Image

_DIRECTION_COUNT = 16  # of edges that are looked at, over half a turn: motion blurs those across it alone
_COSINE_POWER = 8  # power of the cosine by which edges count for a direction
_LEAST_SHARE = 0.5  # of the edges of the strongest direction that another has to have, to count
_STRONG_SHARE = 0.2  # of the strongest slopes: weaker ones are noise, or shading
_BORDER_PX = 10  # about the points


@dataclass(frozen=True)
class EdgeWidth:
    """Widths of edges [px]: across the direction of the narrowest, and of the widest."""

    narrow_px: float
    wide_px: float


def edge_width(image: Image, pixels: Array) -> EdgeWidth | None:
    """The widths of edges about some points: their contrast over their mean slope.

    An ideal edge through a point spread of sigma s has 3.5 s; None if there are no edges.

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
    strong = slope > _STRONG_SHARE * np.quantile(slope, 0.999)
    if not strong.any():
        return None
    across = np.arctan2(v, u)[strong] - np.arange(_DIRECTION_COUNT)[:, None] * np.pi / _DIRECTION_COUNT
    shares = np.cos(across) ** _COSINE_POWER
    lengths, squares = shares @ slope[strong], shares @ slope[strong] ** 2
    counts = lengths > _LEAST_SHARE * lengths.max()
    contrast = float(np.quantile(part, 0.95) - np.quantile(part, 0.05))
    widths = contrast * lengths[counts] / squares[counts]
    return EdgeWidth(float(widths.min()), float(widths.max()))
