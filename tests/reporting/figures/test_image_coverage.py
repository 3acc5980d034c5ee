"""Where points were seen."""

from __future__ import annotations

import numpy as np
from tests.seen_points import seen

from basecal.reporting.figures.image_coverage import image_coverage


def test_squares_are_counted():
    """Two squares of 144, with three points and with one."""
    pixels = [[10.0, 10.0], [20.0, 10.0], [30.0, 10.0], [700.0, 500.0]]
    figure = image_coverage((1280, 720), seen(pixels, np.zeros((4, 2))))
    assert "in 2 of 144 squares (1 %), at most 3 in one" in figure.caption
    assert ">3 points<" in figure.svg
    assert ">1 point<" in figure.svg
    assert figure.svg.count('class="tile"') == 2
