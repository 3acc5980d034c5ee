"""The expected error over the number of samples, with the tolerance."""

from __future__ import annotations

from collections.abc import Sequence

from basecal.reporting.charts import ruled_across, scale_over
from basecal.reporting.figures.figure import Figure
from basecal.reporting.statement.digits import two_digits
from basecal.reporting.svg import drawing, element, text

_WIDTH, _HEIGHT = 640.0, 250.0
_LEFT, _RIGHT, _TOP, _BOTTOM = 62.0, 20.0, 14.0, 30.0


def outlook_figure(outlook: Sequence[tuple[int, float]], recorded: int, tolerance_m: float | None) -> Figure:
    """A line over the samples recorded and so many more planned ones, (count, error [m]) each."""
    values = [1e3 * length for _, length in outlook]
    limits = [] if tolerance_m is None else [1e3 * tolerance_m]
    across = scale_over([recorded + count for count, _ in outlook], _LEFT, _WIDTH - _RIGHT, logarithmic=False)
    up = scale_over([*values, *limits], _HEIGHT - _BOTTOM, _TOP)
    parts = ruled_across(up, _LEFT, _WIDTH - _RIGHT)
    places = [(across.at(recorded + count), up.at(1e3 * length)) for count, length in outlook]
    parts.append(element("path", class_="median", d="M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in places)))
    for (count, length), (x, y) in zip(outlook, places, strict=True):
        label = f"{count} more: {two_digits(1e3 * length)} mm"
        parts.append(element("circle", element("title", text(label)), cx=f"{x:.1f}", cy=f"{y:.1f}", r=4))
        place = {"x": f"{x:.1f}", "y": _HEIGHT - 8, "text_anchor": "middle"}
        parts.append(element("text", str(recorded + count), class_="tick", **place))
    for limit in limits:
        parts.append(element("path", class_="level", d=f"M{_LEFT} {up.at(limit):.1f}H{_WIDTH - _RIGHT}"))
    also = " Dashed: the tolerance." if limits else ""
    said = ", ".join(
        f"{two_digits(value)} mm with {recorded + count}" for value, (count, _) in zip(values, outlook, strict=True)
    )
    svg = drawing(_WIDTH, _HEIGHT, "expected error over samples", element("g", *parts, class_="line-0"))
    return Figure(
        "more samples", svg, f"95 % of errors at the task are expected below this [mm]: {said} samples.{also}"
    )
