"""Line charts on logarithmic axes as SVG, by hand: a few lines of text, no library, nothing loaded."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape

import numpy as np

_WIDTH, _HEIGHT = 720, 440
_LEFT, _RIGHT, _TOP, _BOTTOM = 76, 170, 44, 60
_COLOURS = ("#c0392b", "#1f6fb2", "#444444", "#2e8b57")
_LABEL_GAP = 16.0
_DASHES = ("", "", "6 4", "")


@dataclass(frozen=True)
class Series:
    """A named line: its points as (x, y), both positive."""

    name: str
    points: Sequence[tuple[float, float]]


@dataclass(frozen=True)
class _Axis:
    low: float
    high: float
    start: float
    end: float

    @classmethod
    def over(cls, values: Sequence[float], start: float, end: float) -> _Axis:
        """The axis that holds these values."""
        return cls(float(np.log10(min(values))) - 0.08, float(np.log10(max(values))) + 0.08, start, end)

    def at(self, value: float) -> float:
        """Where a value stands on the drawing."""
        share = (float(np.log10(value)) - self.low) / (self.high - self.low)
        return self.start + share * (self.end - self.start)

    def ticks(self) -> list[float]:
        """The 1, 2 and 5 of every decade in range."""
        decades = range(int(np.floor(self.low)), int(np.ceil(self.high)) + 1)
        every = [m * 10.0**d for d in decades for m in (1, 2, 5)]
        return [t for t in every if self.low <= np.log10(t) <= self.high]


def log_chart(title: str, x_label: str, y_label: str, series: Sequence[Series]) -> str:
    """An SVG of lines over logarithmic axes, the names at the lines' ends.

    Args:
        title: Above the chart.
        x_label: With its unit.
        y_label: With its unit.
        series: At most four lines.
    """
    x = _Axis.over([p[0] for s in series for p in s.points], _LEFT, _WIDTH - _RIGHT)
    y = _Axis.over([p[1] for s in series for p in s.points], _HEIGHT - _BOTTOM, _TOP)
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {_WIDTH} {_HEIGHT}" role="img" '
        f'aria-label="{escape(title)}" font-family="system-ui, sans-serif" font-size="13">',
        f'<rect width="{_WIDTH}" height="{_HEIGHT}" fill="#fff"/>',
        f'<text x="{_LEFT}" y="24" font-size="15" font-weight="600">{escape(title)}</text>',
        *_grid(x, y),
        f'<text x="{(x.start + x.end) / 2}" y="{_HEIGHT - 14}" text-anchor="middle">{escape(x_label)}</text>',
        f'<text transform="translate(18 {(y.start + y.end) / 2}) rotate(-90)" text-anchor="middle">'
        f"{escape(y_label)}</text>",
        *_lines(x, y, series),
        "</svg>",
    ]
    return "\n".join(parts) + "\n"


def _grid(x: _Axis, y: _Axis) -> list[str]:
    parts = []
    for tick in x.ticks():
        at = x.at(tick)
        parts.append(f'<path d="M{at:.1f} {y.start}V{y.end}" stroke="#e4e4e4"/>')
        parts.append(f'<text x="{at:.1f}" y="{y.start + 18}" text-anchor="middle" fill="#444">{tick:g}</text>')
    for tick in y.ticks():
        at = y.at(tick)
        parts.append(f'<path d="M{x.start} {at:.1f}H{x.end}" stroke="#e4e4e4"/>')
        parts.append(f'<text x="{x.start - 8}" y="{at + 4:.1f}" text-anchor="end" fill="#444">{tick:g}</text>')
    return parts


def _lines(x: _Axis, y: _Axis, series: Sequence[Series]) -> list[str]:
    parts = []
    # Labels are moved down so that none covers another.
    heights = [y.at(s.points[-1][1]) for s in series]
    placed: dict[int, float] = {}
    last = -np.inf
    for k in sorted(range(len(heights)), key=lambda i: heights[i]):
        last = max(heights[k], last + _LABEL_GAP)
        placed[k] = last
    ends = [placed[k] for k in range(len(heights))]
    for s, end, colour, dash in zip(series, ends, _COLOURS, _DASHES, strict=False):
        path = "L".join(f"{x.at(a):.1f} {y.at(b):.1f}" for a, b in s.points)
        parts.append(f'<path d="M{path}" fill="none" stroke="{colour}" stroke-width="2" stroke-dasharray="{dash}"/>')
        parts += [f'<circle cx="{x.at(a):.1f}" cy="{y.at(b):.1f}" r="3" fill="{colour}"/>' for a, b in s.points]
        parts.append(f'<text x="{x.end + 10}" y="{end + 4:.1f}" fill="{colour}">{escape(s.name)}</text>')
    return parts
