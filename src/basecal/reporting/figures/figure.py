"""A figure with its words, and the bar that several of them draw."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from basecal.reporting.svg import element, text

HEIGHT = 100.0
BAR = 10.0
FAINTEST = 0.12
"""Opacity of a tile with least in it, which must be told from one with nothing."""


@dataclass(frozen=True)
class Figure:
    """A drawing with its words.

    Attributes:
        title: What it is of.
        svg: The drawing.
        caption: How to read it.
        x: Labels below, evenly spaced.
        y: Labels at the left from top to bottom, evenly spaced.
    """

    title: str
    svg: str
    caption: str
    x: tuple[str, ...] = ()
    y: tuple[str, ...] = ()


def rectangle(kind: str, box: Sequence[float], *inside: str, **more: object) -> str:
    """A rectangle of a class, by its left, top, width and height."""
    sides = (f"{side:.1f}" for side in box)
    return element("rect", *inside, class_=kind, **dict(zip(("x", "y", "width", "height"), sides, strict=True)), **more)


def tile(box: Sequence[float], share: float, label: str = "", kind: str = "tile") -> str:
    """A rectangle filled as strongly as its share of the most, which says what it is when it is pointed at."""
    title = [element("title", text(label))] if label else []
    return rectangle(kind, box, *title, fill_opacity=f"{FAINTEST + (1 - FAINTEST) * share:.2f}")


def bar(x: float, width: float, share: float, label: str, sample: int, kind: str) -> str:
    """A bar of a sample, which can be chosen, that fills a share of the height, at most all of it."""
    height = min(max(HEIGHT * share, 0.5), HEIGHT)
    title = element("title", text(label))
    shown = rectangle("bar", (x + 0.05 * width, HEIGHT - height, 0.9 * width, height))
    return element("g", title, rectangle("hit", (x, 0, width, HEIGHT)), shown, class_=kind, data_sample=sample)
