"""A figure with its words, and the bar that several of them draw."""

from __future__ import annotations

from dataclasses import dataclass

from basecal.reporting.svg import element, text

HEIGHT = 100.0
BAR = 10.0


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


def bar(x: float, width: float, share: float, label: str, sample: int | None = None, kind: str = "view") -> str:
    """A bar that fills a share of the height, at most all of it, with a label. A bar of a sample can be chosen."""
    height = min(max(HEIGHT * share, 0.5), HEIGHT)
    title = element("title", text(label))
    place = {"x": f"{x + 0.05 * width:.2f}", "width": f"{0.9 * width:.2f}"}
    shown = element("rect", class_="bar", y=f"{HEIGHT - height:.2f}", height=f"{height:.2f}", **place)
    if sample is None:
        return element("g", title, shown)
    whole = element("rect", class_="hit", x=f"{x:.2f}", y=0, width=f"{width:.2f}", height=f"{HEIGHT:g}")
    return element("g", title, whole, shown, class_=kind, data_sample=sample)
