"""Places on a polar plot."""

from __future__ import annotations

import numpy as np

from basecal.reporting.figures.rings import MIDDLE, RADIUS, place_on_rings, polar_drawing


def test_places():
    """The middle, half way out, and on the outer ring what is beyond."""
    at = place_on_rings(np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 8.0]]), 2.0)
    np.testing.assert_allclose(at, [[MIDDLE, MIDDLE], [MIDDLE + RADIUS / 2, MIDDLE], [MIDDLE, MIDDLE + RADIUS]])


def test_rings_are_named():
    """A circle and a name each, escaped."""
    svg = polar_drawing("x", [(0.5, "1 <px>"), (1.0, "2 px")])
    assert svg.count("<circle") == 2
    assert "1 &lt;px&gt;" in svg
