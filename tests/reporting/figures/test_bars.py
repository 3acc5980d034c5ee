"""Bars of views."""

from __future__ import annotations

from basecal.cell import SampleResidual
from basecal.reporting.figures.bars import QUANTITIES, bar_figure

VIEWS = [SampleResidual(k, "wrist", "board", value) for k, value in enumerate((0.3, 0.4, 50.0))]


def test_what_was_left_out_is_marked_and_widens_nothing():
    """Its bar is red and ends with the figure; the mean is of the others: 0.35 px."""
    figure = bar_figure(VIEWS, QUANTITIES[0], 10, [VIEWS[2]])
    assert figure.y[0] == "0.5 px"
    assert "dashed: rms over the views used, 0.35 px; orange: left out" in figure.caption
    assert figure.svg.count('class="view stranger"') == 1
    assert "sample 2: 50 px, left out" in figure.svg
    assert 'height="100.0"' in figure.svg


def test_the_largest_of_many():
    """Two of three, in the order of samples."""
    figure = bar_figure(VIEWS, QUANTITIES[0], 2)
    assert "the 2 largest of 3 views" in figure.caption
    assert figure.x == ("sample 1", "2")


def test_nothing_to_show():
    """No view has the quantity; or all were left out."""
    assert bar_figure(VIEWS, QUANTITIES[1], 2) is None
    assert bar_figure(VIEWS[:1], QUANTITIES[0], 2, VIEWS) is not None
