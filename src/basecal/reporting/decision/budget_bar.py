"""The error at the task by source, as one bar."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import accumulate

from basecal.cell import BudgetEntry
from basecal.reporting.figures.curves import COLOURS
from basecal.reporting.figures.figure import Figure
from basecal.reporting.svg import drawing, element, text

_WIDTH, _HEIGHT = 640.0, 34.0
_LABELLED = 0.07  # of the variance, from where on a part has room for its number


def budget_bar(budget: Sequence[BudgetEntry]) -> Figure:
    """Parts as long as their share of the variance, the largest first; the smallest share the last colour."""
    starts = [0.0, *accumulate(entry.share for entry in budget)]
    parts = []
    for number, (entry, start) in enumerate(zip(budget, starts, strict=False)):
        percent = f"{100 * entry.share:.0f} %"
        place = {"x": f"{_WIDTH * start:.1f}", "width": f"{_WIDTH * entry.share:.1f}", "height": _HEIGHT}
        inside = element("title", text(f"{entry.source}: {percent}")) + element("rect", class_="part", **place)
        if entry.share >= _LABELLED:
            middle = f"{_WIDTH * (start + entry.share / 2):.1f}"
            inside += element("text", percent, class_="part-label", x=middle, y=_HEIGHT / 2 + 5, text_anchor="middle")
        parts.append(element("g", inside, class_=f"line-{min(number, COLOURS - 1)}"))
    return Figure("error at the task by source", drawing(_WIDTH, _HEIGHT, "shares of the variance", *parts), "")
