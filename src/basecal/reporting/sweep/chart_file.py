"""Line charts as SVG files: a few lines of text, nothing loaded."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from markupsafe import Markup

from basecal.reporting.figures.curves import HEIGHT, WIDTH, Band, curves
from basecal.reporting.svg import element

_TOP, _LINE = 60, 20
_COLOURS = ("#c0392b", "#1f6fb2", "#444444", "#2e8b57")
_STYLE = (
    "svg{font:13px system-ui,sans-serif;background:#fff}.title{font-size:15px;font-weight:600}.rule{stroke:#e4e4e4}"
    ".tick{fill:#444}.median{fill:none;stroke:currentColor;stroke-width:2}.band{fill:none}g{fill:currentColor}"
    ".line-2 .median{stroke-dasharray:6 4}.line-3 .median{stroke-dasharray:2 4}"
) + "".join(f".line-{k}{{color:{colour}}}" for k, colour in enumerate(_COLOURS))


def chart_file(title: str, x_label: str, y_label: str, series: Mapping[str, Sequence[tuple[float, float]]]) -> str:
    """An SVG of lines over logarithmic axes, their names below.

    Args:
        title: Above the chart.
        x_label: With its unit.
        y_label: With its unit.
        series: The points of at most four lines as (x, y), all positive, by name.
    """
    lines = {name: [Band(x, (y, y, y)) for x, y in points] for name, points in series.items()}
    chart = curves(title, x_label, y_label, lines, logarithmic=True)
    bottom = _TOP + HEIGHT
    names = [
        element("text", f"\u25cf {name}", class_=f"line-{k}", x=62, y=bottom + _LINE * (k + 1), fill="currentColor")
        for k, name in enumerate(series)
    ]
    parts = [
        element("style", Markup(_STYLE)),
        element("text", title, class_="title", x=10, y=24),
        element("text", f"{y_label} over {x_label}", x=10, y=46),
        element("svg", chart, y=_TOP, height=HEIGHT),
        *names,
    ]
    page = {"xmlns": "http://www.w3.org/2000/svg", "viewBox": f"0 0 {WIDTH:g} {bottom + _LINE * (len(series) + 1):g}"}
    return element("svg", *parts, **page, role="img", aria_label=title) + "\n"
