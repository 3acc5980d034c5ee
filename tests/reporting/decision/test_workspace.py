"""The map of the workspace as drawings."""

from __future__ import annotations

import re

import numpy as np

from basecal.cell import ErrorMap
from basecal.reporting.decision.workspace import workspace


def test_a_drawing_for_each_height():
    """A square for each point, the largest error the darkest, x to the right and y upwards."""
    points = np.array([[x, y, z] for x in (0.0, 1.0) for y in (0.0, 2.0) for z in (0.5, 1.0)])
    lengths = np.full(8, 1e-3)
    lengths[-1] = 2e-3
    low, high = workspace(ErrorMap(points, lengths, np.full(8, 0.01)))
    assert (low.title, high.title) == ("at z = 0.500 m", "at z = 1.000 m")
    assert low.svg.count("<rect") == high.svg.count("<rect") == 5
    assert (high.x, high.y) == (("x 0.00 m", "1.00 m"), ("y 2.00 m", "0.00 m"))
    darkest = high.svg[high.svg.index('fill-opacity="1.00"') - 100 :]
    assert 'x="40.0" y="0.0"' in darkest
    assert re.findall(r'class="contour-label"[^>]*>([^<]+)<', high.svg)[0] == "1.2"
    assert "contour" not in low.svg
    assert "(1.000, 2.000, 1.000) m: 2.0 mm and 0.57 deg" in high.svg
    assert "1.0 to 2.0 mm in all" in low.caption
    assert high.svg.count('class="tile worst"') == 1
    assert high.caption.endswith("Outlined: the worst place, 1.00, 2.00, 1.00 m.")
    assert "worst" not in low.svg + low.caption


def test_one_point():
    """A place alone, exact, is a square."""
    (only,) = workspace(ErrorMap(np.zeros((1, 3)), np.zeros(1), np.zeros(1)))
    assert only.x == ("x 0.00 m",)
    assert only.svg.count("<rect") == 2
