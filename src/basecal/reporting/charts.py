"""Scales of charts, and line charts on logarithmic ones as SVG files: a few lines of text, nothing loaded."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from basecal.reporting.svg import element, text, three_digits

_WIDTH, _HEIGHT = 720, 440
_LEFT, _RIGHT, _TOP, _BOTTOM = 76, 170, 44, 60
_COLOURS = ("#c0392b", "#1f6fb2", "#444444", "#2e8b57")
_DASHES = (None, None, "6 4", "2 4")
_LABEL_GAP = 16.0
_STYLE = (
    "svg{font:13px system-ui,sans-serif}text{stroke:none}.title{font-size:15px;font-weight:600}.rule{stroke:#e4e4e4}"
    ".tick{fill:#444;dominant-baseline:central}g path{fill:none;stroke-width:2}"
)
_WIDE = 8.0  # from the least to the greatest value: more is drawn on a logarithmic scale, if nothing else is said
_FEWEST_TICKS = 4
_MANY_DECADES = 3.0  # from there on numbers between the powers of ten would cover one another
_ROOM = 0.06  # of the drawing beside what is outermost


@dataclass(frozen=True)
class Scale:
    """An axis of a drawing, from `start` to `end`; `low` and `high` are logarithms on a logarithmic one."""

    low: float
    high: float
    start: float
    end: float
    logarithmic: bool

    def position(self, value: float) -> float:
        """Where a value stands on the drawing."""
        value = math.log10(value) if self.logarithmic else value
        return self.start + (value - self.low) / (self.high - self.low) * (self.end - self.start)

    def ticks(self) -> list[float]:
        """Round values in range."""
        if self.logarithmic:
            decades = range(math.floor(self.low), math.ceil(self.high) + 1)
            within = (1, 2, 5) if self.high - self.low < _MANY_DECADES else (1,)
            every = [m * 10.0**d for d in decades for m in within]
            return [tick for tick in every if self.low <= math.log10(tick) <= self.high]
        whole = 10.0 ** math.floor(math.log10(self.high - self.low))
        for step in (whole * share for share in (1.0, 0.5, 0.2)):
            found = [k * step for k in range(math.ceil(self.low / step), math.floor(self.high / step) + 1)]
            if len(found) >= _FEWEST_TICKS:
                break
        return found


def fitted_scale(values: Sequence[float], start: float, end: float, logarithmic: bool | None = None) -> Scale:
    """The scale that holds these values; logarithmic if it is not said and they reach far."""
    least, most = min(values), max(values)
    if logarithmic is None:
        logarithmic = least > 0 and most > _WIDE * least
    low, high = (math.log10(least), math.log10(most)) if logarithmic else (least, most)
    room = _ROOM * (high - low) or 0.5 * abs(high) or 1.0
    return Scale(low - room, high + room, start, end, logarithmic)


@dataclass(frozen=True)
class Series:
    """A named line: its points as (x, y), both positive."""

    name: str
    points: Sequence[tuple[float, float]]


def log_chart(title: str, x_label: str, y_label: str, series: Sequence[Series]) -> str:
    """An SVG of lines over logarithmic axes, the names at the lines' ends.

    Args:
        title: Above the chart.
        x_label: With its unit.
        y_label: With its unit.
        series: At most four lines.
    """
    x = fitted_scale([p[0] for s in series for p in s.points], _LEFT, _WIDTH - _RIGHT, True)
    y = fitted_scale([p[1] for s in series for p in s.points], _HEIGHT - _BOTTOM, _TOP, True)
    upwards = f"translate(18 {(y.start + y.end) / 2}) rotate(-90)"
    parts = [
        element("style", _STYLE),
        element("rect", width=_WIDTH, height=_HEIGHT, fill="#fff"),
        element("text", text(title), class_="title", x=_LEFT, y=24),
        *horizontal_rules(y, x.start, x.end),
        *(
            element("path", class_="rule", d=f"M{u} {y.start}V{y.end}")
            + element("text", number, class_="tick", x=u, y=y.start + 18, text_anchor="middle")
            for u, number in _places(x)
        ),
        element("text", text(x_label), x=(x.start + x.end) / 2, y=_HEIGHT - 14, text_anchor="middle"),
        element("text", text(y_label), transform=upwards, text_anchor="middle"),
        *_lines(x, y, series),
    ]
    page = {"xmlns": "http://www.w3.org/2000/svg", "viewBox": f"0 0 {_WIDTH} {_HEIGHT}"}
    return element("svg", "\n".join(parts), **page, role="img", aria_label=title) + "\n"


def horizontal_rules(scale: Scale, left: float, right: float) -> list[str]:
    """A rule and its number at each round value of an upward axis."""
    return [
        element("path", class_="rule", d=f"M{left} {y}H{right}")
        + element("text", number, class_="tick", x=left - 6, y=y, text_anchor="end")
        for y, number in _places(scale)
    ]


def _places(scale: Scale) -> list[tuple[str, str]]:
    return [(f"{scale.position(tick):.1f}", three_digits(tick)) for tick in scale.ticks()]


def _lines(x: Scale, y: Scale, series: Sequence[Series]) -> list[str]:
    parts = []
    last = -math.inf
    for k, s in sorted(enumerate(series), key=lambda each: y.position(each[1].points[-1][1])):
        last = max(y.position(s.points[-1][1]), last + _LABEL_GAP)  # so that no name covers another
        places = [(f"{x.position(a):.1f}", f"{y.position(b):.1f}") for a, b in s.points]
        path = element("path", d="M" + "L".join(f"{u} {v}" for u, v in places), stroke_dasharray=_DASHES[k])
        name = element("text", text(s.name), x=x.end + 10, y=f"{last + 4:.1f}")
        circles = [element("circle", cx=u, cy=v, r=3) for u, v in places]
        parts.append(element("g", path, *circles, name, stroke=_COLOURS[k], fill=_COLOURS[k]))
    return parts
