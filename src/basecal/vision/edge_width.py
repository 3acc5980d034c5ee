"""Width of edges in an image in all directions, which motion blur and defocus increase."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from basecal.geometry import Array
from basecal.vision.detection import Image

_DIRECTION_COUNT = 16  # directions over half a turn: motion blurs only edges across it
_COSINE_POWER = 8  # power of the cosine that weights edges for a direction
_LEAST_SHARE = 0.5  # edges of a direction relative to the direction with the most, below which it is ignored
_STRONG_SHARE = 0.2  # of the largest gradient: weaker ones are noise or shading
_BORDER_PX = 10  # margin around the points


@dataclass(frozen=True)
class EdgeWidth:
    """Widths of edges [px] in the directions of the narrowest and of the widest edges."""

    narrow_px: float
    wide_px: float


def edge_width(image: Image, pixels: Array) -> EdgeWidth | None:
    """Widths of edges around some points: contrast over mean gradient; None if there are no edges.

    An ideal edge with a Gaussian point spread of sigma s has a width of 3.5 s.

    Args:
        image: (h, w).
        pixels: (n, 2) points of a target, whose bounding box is examined.
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
