"""SVG elements with escaped content."""

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
"""Opacity of a tile with the smallest value, which must differ from an empty tile."""


def element(name: str, *inside: str, title: object = None, **attributes: object) -> Markup:
    """An SVG element; its text and attributes are escaped.

    Args:
        name: Name of the element, such as `path`.
        inside: Content: elements or text.
        title: Tooltip; None for none.
        attributes: `class_` and `stroke_width` represent `class` and `stroke-width`; None omits an attribute. Floats
            have one decimal.
    """
    given = {key.rstrip("_").replace("_", "-"): value for key, value in attributes.items() if value is not None}
    shown = ((key, f"{value:.1f}" if isinstance(value, float) else value) for key, value in given.items())
    pairs = "".join(f' {key}="{escape(value)}"' for key, value in shown)
    first = [] if title is None else [element("title", str(title))]
    return Markup(f"<{name}{pairs}>{Markup().join([*first, *inside])}</{name}>")


def path(kind: str, data: str, **attributes: object) -> Markup:
    """A path with a class."""
    return element("path", class_=kind, d=data, **attributes)


def drawing(width: float, height: float, label: str, *inside: str, stretch: bool = False) -> Markup:
    """A drawing with a text alternative; `stretch` lets it fill any box."""
    ratio = "none" if stretch else None
    view = f"0 0 {width:g} {height:g}"
    return element("svg", *inside, title=label, role="img", viewBox=view, preserveAspectRatio=ratio)


def wrapped_label(label: str, lines: Sequence[str], place: tuple[float, float], anchor: str) -> Markup:
    """A label as the lines of `label_lines`, below one another.

    Args:
        label: The full text, also the tooltip.
        lines: Lines of the text.
        place: x and y of the first line.
        anchor: Alignment of lines at x: `start`, `middle` or `end`.
    """
    x, y = place
    more = [element("tspan", line, x=x, dy="1.15em") for line in lines[1:]]
    return element("text", lines[0], *more, title=label, class_="tick", x=x, y=y, text_anchor=anchor)


def label_lines(label: str, characters: int, most_lines: int = 99) -> list[str]:
    """Wrap a label to lines of at most `characters`; longer words are broken.

    The last of `most_lines` ends with an ellipsis if there is more text.
    """
    return wrap(label, max(characters, 2), max_lines=most_lines, placeholder="…", break_on_hyphens=False) or [""]


def segments(ends: Iterable[Array | tuple[Array, Array]]) -> str:
    """Path data of line segments, each (2, 2)."""
    return "".join(f"M{a[0]:.1f} {a[1]:.1f}L{b[0]:.1f} {b[1]:.1f}" for a, b in ends)


def dots(points: Iterable[Array]) -> str:
    """Path data of zero-length lines, which round caps show as dots."""
    return "".join(f"M{x:.1f} {y:.1f}h0" for x, y in points)


def three_digits(value: float) -> str:
    """A number with three significant digits and separated thousands, such as 6,400."""
    return f"{float(f'{value:.3g}'):,.15g}"


def nice_ceiling(value: float) -> float:
    """The smallest of 1, 2, 2.5, 5 times a power of ten that is not below a value; 1 if it is not positive."""
    if not (math.isfinite(value) and value > 0):
        return 1.0
    decade = 10.0 ** math.floor(math.log10(value))
    return next(m * decade for m in (1, 2, 2.5, 5, 10) if m * decade >= value * (1 - 1e-9))


@dataclass(frozen=True)
class Figure:
    """A drawing with its texts.

    Attributes:
        title: Title of the figure.
        svg: The drawing.
        caption: Explanation of the drawing.
        x: Labels below, evenly spaced.
        y: Labels at the left from top to bottom, evenly spaced.
    """

    title: str
    svg: Markup
    caption: str
    x: tuple[str, ...] = ()
    y: tuple[str, ...] = ()


def rectangle(kind: str, box: Sequence[float], **more: object) -> Markup:
    """A rectangle with a class, from its left, top, width and height."""
    x, y, width, height = map(float, box)
    return element("rect", class_=kind, x=x, y=y, width=width, height=height, **more)


def tile(box: Sequence[float], share: float, label: str | None = None, kind: str = "tile") -> Markup:
    """A rectangle whose opacity is proportional to a share, 0 to 1, with a tooltip."""
    return rectangle(kind, box, title=label, fill_opacity=f"{FAINTEST + (1 - FAINTEST) * share:.2f}")


def bar(x: float, width: float, share: float, label: str, sample: int, kind: str) -> Markup:
    """A selectable bar of a sample that fills a share of the height, at most all of it."""
    height = min(max(HEIGHT * share, 0.5), HEIGHT)
    shown = rectangle("bar", (x + 0.05 * width, HEIGHT - height, 0.9 * width, height))
    return element("g", rectangle("hit", (x, 0, width, HEIGHT)), shown, title=label, class_=kind, data_sample=sample)
