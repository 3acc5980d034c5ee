"""Binary format of points with descriptors: coordinates of all points, then all descriptors."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from basecal.geometry import Array

DESCRIPTOR_LENGTH = 128
"""Length of a descriptor."""


def row_bytes(width: int) -> int:
    """Number of bytes of a point with `width` coordinates and its descriptor."""
    return 8 * width + DESCRIPTOR_LENGTH


def points_to_bytes(points: Array, descriptors: NDArray[np.uint8]) -> bytes:
    """Convert points (n, width) and descriptors (n, 128) to the content of a file."""
    return points.astype("<f8").tobytes() + descriptors.tobytes()


def points_from_bytes(data: bytes, width: int) -> tuple[Array, NDArray[np.uint8]] | None:
    """Parse points (n, width) and descriptors (n, 128); None if the data are not in this format."""
    count, rest = divmod(len(data), row_bytes(width))
    points = np.frombuffer(data, dtype="<f8", count=width * count).reshape(count, width).astype(np.float64)
    descriptors = np.frombuffer(data, dtype=np.uint8, offset=8 * width * count)
    return None if rest or not np.isfinite(points).all() else (points, descriptors.reshape(count, DESCRIPTOR_LENGTH))
