"""Places and what they look like, in bytes: numbers of all places, then the levels of all descriptors."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from basecal.geometry import Array

DESCRIPTOR = 128
"""Numbers of a descriptor."""


def row_bytes(width: int) -> int:
    """Bytes of a place of so many numbers."""
    return 8 * width + DESCRIPTOR


def places_to_bytes(places: Array, levels: NDArray[np.uint8]) -> bytes:
    """The file of places (n, width) with levels (n, 128)."""
    return places.astype("<f8").tobytes() + levels.tobytes()


def places_from_bytes(data: bytes, width: int) -> tuple[Array, NDArray[np.uint8]] | None:
    """Places (n, width) and levels (n, 128); None if it is no such file."""
    count, rest = divmod(len(data), row_bytes(width))
    places = np.frombuffer(data, dtype="<f8", count=width * count).reshape(count, width).astype(np.float64)
    levels = np.frombuffer(data, dtype=np.uint8, offset=8 * width * count)
    return None if rest or not np.isfinite(places).all() else (places, levels.reshape(count, DESCRIPTOR))
