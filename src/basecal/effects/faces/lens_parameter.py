"""An effect as parameters of a lens."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from basecal.geometry import Array, Camera


@dataclass(frozen=True, eq=False)
class LensParameter:
    """Parameters of a lens that have an error of one size.

    Attributes:
        where: Their places among a lens's parameters.
        usual: Sigmas of their errors in a usual calibration, (k,).
        source: Of these, or `assumed`.
        off: By how much a stated lens is off an estimated one with its sigmas, in words.
    """

    where: slice
    usual: Callable[[Camera], Array]
    source: str
    off: Callable[[Camera, Camera, Array], str]
