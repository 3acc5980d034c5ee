"""Charts in files: well-formed, every point inside the frame, names apart and escaped."""

from __future__ import annotations

from xml.etree import ElementTree

from basecal.reporting.sweep.chart_file import chart_file

SVG = "{http://www.w3.org/2000/svg}"
SERIES = {"a < b": [(0.01, 5.0), (0.1, 0.5), (1.0, 0.05)], "c": [(0.01, 4.9), (1.0, 0.051)]}


def chart(series=SERIES):
    return ElementTree.fromstring(chart_file("errors & lengths", "length [m]", "error [deg]", series))


def markers(drawing):
    return [(float(c.get("cx")), float(c.get("cy"))) for c in drawing.iter(f"{SVG}circle")]


def test_points_lie_inside_the_frame():
    """Every marker is within the axes."""
    found = markers(chart())
    assert len(found) == 5
    assert all(62 <= x <= 626 and 12 <= y <= 248 for x, y in found)


def test_decades_are_evenly_apart():
    """On a logarithmic axis 0.01, 0.1 and 1 stand at equal distances."""
    (x0, _), (x1, _), (x2, _), *_ = markers(chart())
    assert abs((x1 - x0) - (x2 - x1)) < 0.11


def test_names_and_axes_are_told():
    """Names below one another, each in its line's colour; what is across and upwards, above."""
    drawing = chart()
    names = {t.text: t for t in drawing.iter(f"{SVG}text") if t.get("class", "").startswith("line-")}
    assert list(names) == ["\u25cf a < b", "\u25cf c"]
    first, second = (float(t.get("y")) for t in names.values())
    assert second - first >= 16
    assert [g.get("class") for g in drawing.iter(f"{SVG}g")] == ["line-0", "line-1"]
    assert "error [deg] over length [m]" in [t.text for t in drawing.iter(f"{SVG}text")]


def test_larger_values_stand_further_right_and_up():
    """Points of a line of slope one are evenly apart along both axes."""
    (x0, y0), (x1, y1), (x2, y2) = markers(chart({"a": [(1.0, 10.0), (10.0, 100.0), (100.0, 1000.0)]}))
    assert abs(x2 - 2 * x1 + x0) <= 0.2
    assert abs(y2 - 2 * y1 + y0) <= 0.2
    assert x2 > x1 > x0
    assert y2 < y1 < y0
