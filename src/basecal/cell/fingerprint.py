"""Points of the static scene, used to recognise the scene later."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from basecal.geometry import Array


@dataclass(frozen=True, eq=False)
class Fingerprint:
    """Points of a scene and their descriptors.

    Attributes:
        points: (n, 3) in `world` [m].
        descriptors: (n, 128) unit vectors with entries between 0 and 1, quantized to bytes.
    """

    points: Array
    descriptors: NDArray[np.uint8]

    def __len__(self) -> int:
        return len(self.points)
