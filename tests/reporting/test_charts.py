"""Charts: well-formed, every point inside the frame, labels apart and escaped."""

from __future__ import annotations

import re
from xml.etree import ElementTree

from basecal.reporting.charts import Series, log_chart

SVG = "{http://www.w3.org/2000/svg}"


def chart():
    series = [Series("a < b", [(0.01, 5.0), (0.1, 0.5), (1.0, 0.05)]), Series("c", [(0.01, 4.9), (1.0, 0.051)])]
    return ElementTree.fromstring(log_chart("errors & lengths", "length [m]", "error [deg]", series))


def test_points_lie_inside_the_frame():
    """Every marker is within the axes."""
    markers = [(float(c.get("cx")), float(c.get("cy"))) for c in chart().iter(f"{SVG}circle")]
    assert len(markers) == 5
    assert all(76 <= x <= 550 and 44 <= y <= 380 for x, y in markers)


def test_decades_are_evenly_apart():
    """On a logarithmic axis 0.01, 0.1 and 1 stand at equal distances."""
    at = {
        t.text: float(t.get("x")) for t in chart().iter(f"{SVG}text") if t.get("text-anchor") == "middle" and t.get("x")
    }
    assert abs((at["0.1"] - at["0.01"]) - (at["1"] - at["0.1"])) < 0.11


def test_names_do_not_cover_one_another():
    """Two lines that end together are named one below the other."""
    names = [float(t.get("y")) for t in chart().iter(f"{SVG}text") if re.fullmatch(r"#\w{6}", t.get("fill") or "")]
    assert len(names) == 2
    assert abs(names[0] - names[1]) >= 16
