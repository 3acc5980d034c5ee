"""A figure with its words, and the bar that several of them draw."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from markupsafe import Markup

from basecal.reporting.svg import element

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
    svg: Markup
    caption: str
    x: tuple[str, ...] = ()
    y: tuple[str, ...] = ()


def rectangle(kind: str, box: Sequence[float], **more: object) -> Markup:
    """A rectangle of a class, by its left, top, width and height."""
    x, y, width, height = map(float, box)
    return element("rect", class_=kind, x=x, y=y, width=width, height=height, **more)


def tile(box: Sequence[float], share: float, label: str | None = None, kind: str = "tile") -> Markup:
    """A rectangle filled as strongly as its share of the most, which says what it is when it is pointed at."""
    return rectangle(kind, box, title=label, fill_opacity=f"{FAINTEST + (1 - FAINTEST) * share:.2f}")


def bar(x: float, width: float, share: float, label: str, sample: int, kind: str) -> Markup:
    """A bar of a sample, which can be chosen, that fills a share of the height, at most all of it."""
    height = min(max(HEIGHT * share, 0.5), HEIGHT)
    shown = rectangle("bar", (x + 0.05 * width, HEIGHT - height, 0.9 * width, height))
    return element("g", rectangle("hit", (x, 0, width, HEIGHT)), shown, title=label, class_=kind, data_sample=sample)
