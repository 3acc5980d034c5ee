"""An effect as parameters of a lens that is stated without sigmas."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from basecal.geometry import Array, Camera


@dataclass(frozen=True, eq=False)
class LensParameter:
    """Parameters of a lens whose errors have one size.

    Attributes:
        where: Their places among a lens's parameters.
        usual: Sigmas of their errors in a usual calibration, (k,).
        source: Of these, or `assumed`.
        words: By how much a stated lens is off an estimated one whose parameters have sigmas, (4 + n,).
        is_each_alone: Whether one may be far off and the others not; else their errors have one size.
    """

    where: slice
    usual: Callable[[Camera], Array]
    source: str
    words: Callable[[Camera, Camera, Array], str]
    is_each_alone: bool = False
