"""The expected error over the number of samples, with the tolerance."""

from __future__ import annotations

from collections.abc import Sequence

from basecal.reporting.charts import fitted_scale, horizontal_rules
from basecal.reporting.figures.figure import Figure
from basecal.reporting.statement.digits import two_digits
from basecal.reporting.svg import drawing, element, text

_WIDTH, _HEIGHT = 640.0, 250.0
_LEFT, _RIGHT, _TOP, _BOTTOM = 62.0, 20.0, 14.0, 30.0
_LABELLED = 8  # places along the line, at most: more numbers would cover one another


def outlook_figure(outlook: Sequence[tuple[int, float]], recorded_count: int, tolerance_m: float | None) -> Figure:
    """A line over the samples recorded and so many more planned ones, (count, error [m]) each."""
    points = [(recorded_count + count, length) for count, length in outlook]
    return error_curve("expected error at the task, 95 %, with more samples", points, tolerance_m)


def error_curve(title: str, points: Sequence[tuple[int, float]], tolerance_m: float | None) -> Figure:
    """A line over numbers of samples, (count, error [m]) each, with the tolerance."""
    limits = [] if tolerance_m is None else [1e3 * tolerance_m]
    across = fitted_scale([count for count, _ in points], _LEFT, _WIDTH - _RIGHT, logarithmic=False)
    up = fitted_scale([*(1e3 * length for _, length in points), *limits], _HEIGHT - _BOTTOM, _TOP)
    parts = horizontal_rules(up, _LEFT, _WIDTH - _RIGHT)
    places = [(across.position(count), up.position(1e3 * length)) for count, length in points]
    parts.append(element("path", class_="median", d="M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in places)))
    step = -(-len(points) // _LABELLED)
    for k, ((count, length), (x, y)) in enumerate(zip(points, places, strict=True)):
        label = f"{count} samples: {two_digits(1e3 * length)} mm"
        parts.append(element("circle", element("title", text(label)), cx=f"{x:.1f}", cy=f"{y:.1f}", r=4))
        if (len(points) - 1 - k) % step == 0:
            place = {"x": f"{x:.1f}", "y": _HEIGHT - 8, "text_anchor": "middle"}
            parts.append(element("text", str(count), class_="tick", **place))
    for limit in limits:
        parts.append(element("path", class_="level", d=f"M{_LEFT} {up.position(limit):.1f}H{_WIDTH - _RIGHT}"))
    also = f" Dashed: the tolerance, {limits[0]:.3g} mm." if limits else ""
    ends = [points[0], *points[-1:]]
    said = ", ".join(f"{two_digits(1e3 * length)} mm with {count}" for count, length in ends)
    svg = drawing(_WIDTH, _HEIGHT, title, element("g", *parts, class_="line-0"))
    return Figure(f"{title} [mm]", svg, f"{said} samples.{also}")
