"""Elements of SVG, everything in them escaped."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from textwrap import wrap

from markupsafe import Markup, escape

from basecal.geometry import Array

HEIGHT = 100.0
BAR = 10.0
FAINTEST = 0.12
"""Opacity of a tile with least in it, which must be told from one with nothing."""


def element(name: str, *inside: str, title: object = None, **attributes: object) -> Markup:
    """An element; words in it, and its attributes, may hold anything.

    Args:
        name: Such as `path`.
        inside: What it holds: elements, or words.
        title: What it says when it is pointed at; None for nothing.
        attributes: `class_` and `stroke_width` represent `class` and `stroke-width`; None leaves one out. Fractions
            have one decimal.
    """
    given = {key.rstrip("_").replace("_", "-"): value for key, value in attributes.items() if value is not None}
    shown = ((key, f"{value:.1f}" if isinstance(value, float) else value) for key, value in given.items())
    pairs = "".join(f' {key}="{escape(value)}"' for key, value in shown)
    first = [] if title is None else [element("title", str(title))]
    return Markup(f"<{name}{pairs}>{Markup().join([*first, *inside])}</{name}>")


def path(kind: str, data: str, **attributes: object) -> Markup:
    """A path of a class."""
    return element("path", class_=kind, d=data, **attributes)


def drawing(width: float, height: float, label: str, *inside: str, stretch: bool = False) -> Markup:
    """A drawing with a name for those who cannot see it; `stretch` lets it fill any box."""
    ratio = "none" if stretch else None
    view = f"0 0 {width:g} {height:g}"
    return element("svg", *inside, title=label, role="img", viewBox=view, preserveAspectRatio=ratio)


def wrapped_label(label: str, lines: Sequence[str], place: tuple[float, float], anchor: str) -> Markup:
    """A label as lines below one another, which are those of `label_lines`.

    Args:
        label: What it says; in full as its title, too.
        lines: Of it.
        place: x and y of the first line.
        anchor: Where a line has its x: `start`, `middle` or `end`.
    """
    x, y = place
    more = [element("tspan", line, x=x, dy="1.15em") for line in lines[1:]]
    return element("text", lines[0], *more, title=label, class_="tick", x=x, y=y, text_anchor=anchor)


def label_lines(label: str, characters: int, most_lines: int = 99) -> list[str]:
    """Lines of so many characters at most; words are broken if they are longer. The last line that there may be ends
    with an ellipsis if there were more.
    """
    return wrap(label, max(characters, 2), max_lines=most_lines, placeholder="…", break_on_hyphens=False) or [""]


def segments(ends: Iterable[Array | tuple[Array, Array]]) -> str:
    """Path data of straight lines, each (2, 2)."""
    return "".join(f"M{a[0]:.1f} {a[1]:.1f}L{b[0]:.1f} {b[1]:.1f}" for a, b in ends)


def dots(points: Iterable[Array]) -> str:
    """Path data of lines without length, which round caps show as dots."""
    return "".join(f"M{x:.1f} {y:.1f}h0" for x, y in points)


def three_digits(value: float) -> str:
    """A number to three digits with its thousands set apart, such as 6,400."""
    return f"{float(f'{value:.3g}'):,.15g}"


def nice_ceiling(value: float) -> float:
    """The smallest of 1, 2, 2.5, 5 times a power of ten that is not below a value; 1 for what is not positive."""
    if not (math.isfinite(value) and value > 0):
        return 1.0
    decade = 10.0 ** math.floor(math.log10(value))
    return next(m * decade for m in (1, 2, 2.5, 5, 10) if m * decade >= value * (1 - 1e-9))


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
