"""Scales of charts."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from markupsafe import Markup

from basecal.reporting.svg import element, path, three_digits

_WIDE = 8.0  # ratio of the largest to the smallest value, above which the default is a logarithmic scale
_FEWEST_TICKS = 4
_MANY_DECADES = 3.0  # from which only powers of ten are labelled
_ROOM = 0.06  # margin beyond the outermost values, as a share of the range


@dataclass(frozen=True)
class Scale:
    """An axis of a drawing, from `start` to `end`; `low` and `high` are logarithms on a logarithmic one."""

    low: float
    high: float
    start: float
    end: float
    logarithmic: bool

    def position(self, value: float) -> float:
        """Position of a value on the drawing."""
        value = math.log10(value) if self.logarithmic else value
        return self.start + (value - self.low) / (self.high - self.low) * (self.end - self.start)

    def ticks(self) -> list[float]:
        """Round values in range."""
        if self.logarithmic:
            decades = range(math.floor(self.low), math.ceil(self.high) + 1)
            multiples = (1, 2, 5) if self.high - self.low < _MANY_DECADES else (1,)
            candidates = [m * 10.0**d for d in decades for m in multiples]
            return [tick for tick in candidates if self.low <= math.log10(tick) <= self.high]
        decade = 10.0 ** math.floor(math.log10(self.high - self.low))
        for step in (decade * share for share in (1.0, 0.5, 0.2)):
            ticks = [k * step for k in range(math.ceil(self.low / step), math.floor(self.high / step) + 1)]
            if len(ticks) >= _FEWEST_TICKS:
                break
        return ticks


def fitted_scale(values: Sequence[float], start: float, end: float, logarithmic: bool | None = None) -> Scale:
    """A scale for some values; by default logarithmic if they span a wide range."""
    least, most = min(values), max(values)
    if logarithmic is None:
        logarithmic = least > 0 and most > _WIDE * least
    low, high = (math.log10(least), math.log10(most)) if logarithmic else (least, most)
    room = _ROOM * (high - low) or 0.5 * abs(high) or 1.0
    return Scale(low - room, high + room, start, end, logarithmic)


def horizontal_rules(scale: Scale, left: float, right: float) -> list[Markup]:
    """A grid line and its number at each tick of a vertical axis."""
    parts = []
    for tick in scale.ticks():
        y = scale.position(tick)
        number = element("text", three_digits(tick), class_="tick", x=left - 6, y=y, dy="0.32em", text_anchor="end")
        parts += [path("rule", f"M{left} {y:.1f}H{right}"), number]
    return parts


def value_text(value: object) -> str:
    """A value of an axis as text; numbers in their shortest form."""
    return f"{value:g}" if isinstance(value, float) else str(value)
