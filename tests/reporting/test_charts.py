"""Charts: well-formed, every point inside the frame, labels apart and escaped."""

from __future__ import annotations

from xml.etree import ElementTree

import pytest

from basecal.reporting.charts import Series, fitted_scale, log_chart

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
    names = [float(t.get("y")) for group in chart().iter(f"{SVG}g") for t in group.iter(f"{SVG}text")]
    assert len(names) == 2
    assert abs(names[0] - names[1]) >= 16


def test_larger_values_stand_further_right_and_up():
    """Points of a line of slope one are evenly apart along both axes."""
    line = [Series("a", [(1.0, 10.0), (10.0, 100.0), (100.0, 1000.0)])]
    drawing = ElementTree.fromstring(log_chart("a < b", "x [m]", "y [s]", line))
    (x0, y0), (x1, y1), (x2, y2) = ((float(c.get("cx")), float(c.get("cy"))) for c in drawing.iter(f"{SVG}circle"))
    assert abs(x2 - 2 * x1 + x0) <= 0.2
    assert abs(y2 - 2 * y1 + y0) <= 0.2
    assert x2 > x1 > x0
    assert y2 < y1 < y0


def test_a_scale_is_logarithmic_where_values_reach_far():
    """If it is not said; its ends are beyond the values, and round values lie in it."""
    assert fitted_scale([1.0, 100.0], 0.0, 10.0).logarithmic
    near = fitted_scale([1.0, 2.0], 0.0, 10.0)
    assert not near.logarithmic
    assert 0 < near.position(1.0) < near.position(2.0) < 10
    assert near.ticks() == pytest.approx([1.0, 1.2, 1.4, 1.6, 1.8, 2.0])
    assert fitted_scale([1.0, 2.0], 0.0, 10.0, logarithmic=True).logarithmic
