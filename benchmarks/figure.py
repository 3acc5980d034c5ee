"""Figures as SVG: panels of lines on two logarithmic axes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import ceil, floor, log10
from xml.sax.saxutils import escape

WIDTH, HEIGHT = 460, 360
LEFT, RIGHT, TOP, BOTTOM = 72, 34, 40, 52
COLOURS = "#0b6e99", "#c2571a", "#3f7d3a", "#8a8a8a"
DASHES = "", "", "7 5", "2 4"
_EXACT = 1e-9
INK, GRID, PAPER = "#222222", "#e3e3e3", "#ffffff"


@dataclass(frozen=True)
class Panel:
    """Lines on one pair of logarithmic axes.

    Attributes:
        title: Above the panel.
        x_label: With its unit.
        y_label: With its unit.
        lines: Points (x, y) by name, both positive; the names stand in the legend.
    """

    title: str
    x_label: str
    y_label: str
    lines: Mapping[str, Sequence[tuple[float, float]]]


@dataclass(frozen=True)
class _Axis:
    """From a decade to a decade, along pixels."""

    low: int
    high: int
    start: float
    end: float

    def at(self, value: float) -> float:
        return self.start + (log10(value) - self.low) / (self.high - self.low) * (self.end - self.start)

    @property
    def decades(self) -> list[int]:
        return list(range(self.low, self.high + 1))


def _axis(values: Sequence[float], start: float, end: float) -> _Axis:
    low, high = floor(log10(min(values)) + _EXACT), ceil(log10(max(values)) - _EXACT)
    return _Axis(low, max(high, low + 1), start, end)


def _text(x: float, y: float, text: str, anchor: str = "middle", more: str = "") -> str:
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" {more}>{escape(text)}</text>'


def _line(x1: float, y1: float, x2: float, y2: float, colour: str) -> str:
    return f'<line x1="{x1:.1f}" y1="{y1:.1f}" x2="{x2:.1f}" y2="{y2:.1f}" stroke="{colour}"/>'


def _tick(decade: int) -> str:
    """A power of ten: written out from 0.01 to 100,000."""
    return f"{10**decade:,}" if 0 <= decade <= 5 else f"{10.0**decade:g}" if -2 <= decade < 0 else f"1e{decade}"


def _frame(panel: Panel, x: _Axis, y: _Axis) -> list[str]:
    out = [_line(x.at(10.0**d), y.start, x.at(10.0**d), y.end, GRID) for d in x.decades]
    out += [_line(x.start, y.at(10.0**d), x.end, y.at(10.0**d), GRID) for d in y.decades]
    out += [_line(x.start, y.start, x.end, y.start, INK), _line(x.start, y.start, x.start, y.end, INK)]
    out += [_text(x.at(10.0**d), y.start + 18, _tick(d)) for d in x.decades]
    out += [_text(x.start - 8, y.at(10.0**d) + 4, _tick(d), "end") for d in y.decades]
    middle = (y.start + y.end) / 2
    turned = f'transform="rotate(-90 {x.start - 54:.1f} {middle:.1f})"'
    out.append(_text((x.start + x.end) / 2, y.start + 40, panel.x_label))
    out.append(_text(x.start - 54, middle, panel.y_label, more=turned))
    out.append(_text((x.start + x.end) / 2, y.end - 16, panel.title, more='font-weight="bold"'))
    return out


def _drawn(name: str, points: Sequence[tuple[float, float]], number: int, x: _Axis, y: _Axis) -> list[str]:
    colour, dashes = COLOURS[number % len(COLOURS)], DASHES[number % len(DASHES)]
    places = [(x.at(a), y.at(b)) for a, b in points]
    path = " ".join(f"{a:.1f},{b:.1f}" for a, b in places)
    level = y.end + 18 + 18 * number
    return [
        f'<polyline points="{path}" fill="none" stroke="{colour}" stroke-width="2" stroke-dasharray="{dashes}"/>',
        *(f'<circle cx="{a:.1f}" cy="{b:.1f}" r="3.5" fill="{colour}"/>' for a, b in places),
        f'<line x1="{x.start + 10:.1f}" y1="{level - 4:.1f}" x2="{x.start + 36:.1f}" y2="{level - 4:.1f}" '
        f'stroke="{colour}" stroke-width="2" stroke-dasharray="{dashes}"/>',
        _text(x.start + 44, level, name, "start"),
    ]


def _panel(panel: Panel, offset: float) -> list[str]:
    every = [point for line in panel.lines.values() for point in line]
    x = _axis([a for a, _ in every], offset + LEFT, offset + WIDTH - RIGHT)
    y = _axis([b for _, b in every], HEIGHT - BOTTOM, TOP)
    out = _frame(panel, x, y)
    for number, (name, points) in enumerate(panel.lines.items()):
        out += _drawn(name, points, number, x, y)
    return out


def svg(panels: Sequence[Panel]) -> str:
    """A figure of panels side by side, on white."""
    width = WIDTH * len(panels)
    parts = [part for k, panel in enumerate(panels) for part in _panel(panel, WIDTH * k)]
    head = (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {HEIGHT}" width="{width}" height="{HEIGHT}" '
        f'font-family="sans-serif" font-size="12" fill="{INK}">'
    )
    return "\n".join([head, f'<rect width="{width}" height="{HEIGHT}" fill="{PAPER}"/>', *parts, "</svg>"]) + "\n"
