"""Points of the static scene by which a cell is recognised later."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from basecal.geometry import Array


@dataclass(frozen=True, eq=False)
class Fingerprint:
    """Points of a scene, and what they look like.

    Attributes:
        points: (n, 3) in `world` [m].
        descriptors: (n, 128) levels of numbers between 0 and 1, of unit length each.
    """

    points: Array
    descriptors: NDArray[np.uint8]

    def __len__(self) -> int:
        return len(self.points)
