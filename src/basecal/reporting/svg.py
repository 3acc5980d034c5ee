"""Elements of SVG as text, everything in them escaped."""

from __future__ import annotations

import math
from collections.abc import Iterable
from html import escape
from textwrap import wrap

from basecal.geometry import Array


def element(name: str, *inside: str, **attributes: object) -> str:
    """An element; `class_` and `stroke_width` represent `class` and `stroke-width`, and None leaves one out.

    Args:
        name: Such as `path`.
        inside: What it holds: elements, or text that `text` has escaped.
        attributes: Their values are escaped.
    """
    given = {key.rstrip("_").replace("_", "-"): value for key, value in attributes.items() if value is not None}
    pairs = "".join(f' {key}="{escape(str(value))}"' for key, value in given.items())
    return f"<{name}{pairs}>{''.join(inside)}</{name}>"


def text(label: str) -> str:
    """Text that may hold anything."""
    return escape(label)


def drawing(width: float, height: float, label: str, *inside: str, stretch: bool = False) -> str:
    """A drawing with a name for those who cannot see it; `stretch` lets it fill any box."""
    view = {"viewBox": f"0 0 {width:g} {height:g}", "preserveAspectRatio": "none" if stretch else None}
    return element("svg", element("title", text(label)), *inside, role="img", **view)


def wrapped_label(label: str, characters: int, place: tuple[float, float], anchor: str, most_lines: int = 99) -> str:
    """A label as lines below one another; words are broken if they are longer than a line.

    Args:
        label: What it says; in full as its title, too.
        characters: Of a line, at most.
        place: x and y of the first line.
        anchor: Where a line has its x: `start`, `middle` or `end`.
        most_lines: Of which the last ends with an ellipsis if there were more.
    """
    lines = label_lines(label, characters, most_lines)
    x, y = (f"{value:.1f}" for value in place)
    more = [element("tspan", text(line), x=x, dy="1.15em") for line in lines[1:]]
    title = element("title", text(label))
    return element("text", title, text(lines[0]), *more, class_="tick", x=x, y=y, text_anchor=anchor)


def label_lines(label: str, characters: int, most_lines: int = 99) -> list[str]:
    """The lines of `wrapped_label`."""
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
