"""An effect as a shape of a target: coefficients under a prior, which all views share."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from basecal.effects.faces.found_effect import Words
from basecal.geometry import Array


@dataclass(frozen=True, eq=False)
class TargetParameter:
    """A shape that differs from the stated one.

    Attributes:
        unit_shifts: How points of a target, (p, 3) [m], move by one sigma of each coefficient, (p, 3, k) [m].
        source: Of the sigmas, or `assumed`.
        words: Of the shape of a target's points, (p, 3), by its coefficients, (k,); None if it is too small to report.
    """

    unit_shifts: Callable[[Array], Array]
    source: str
    words: Callable[[str, Array, Array], Words | None]
