"""Tests of bar figures of views."""

from __future__ import annotations

import numpy as np
from tests.drawings import ends, rectangles, view

from basecal.cell import SampleResidual
from basecal.reporting.figures.bars import QUANTITIES, bar_figure

VIEWS = [SampleResidual(k, "wrist", "board", value) for k, value in enumerate((0.3, 0.4, 50.0))]


def test_excluded_view_is_marked_and_keeps_scale():
    """The bar of an excluded view is marked and ends with the figure. The rms is that of the others: 0.35 px."""
    figure = bar_figure(VIEWS, QUANTITIES[0], 10, [VIEWS[2]])
    assert figure.y[0] == "0.5 px"
    assert "dashed: rms over the views used, 0.35 px; orange: left out" in figure.caption
    assert figure.svg.count('class="view stranger"') == 1
    assert "sample 2: 50 px, left out" in figure.svg
    assert 'height="100.0"' in figure.svg


def test_largest_views_are_shown():
    """Two of three views are shown, in the order of samples."""
    figure = bar_figure(VIEWS, QUANTITIES[0], 2)
    assert "the 2 largest of 3 views" in figure.caption
    assert figure.x == ("sample 1", "2")


def test_quantity_without_values_has_no_figure():
    """A figure is missing if no view has the quantity, but not if all views are excluded."""
    assert bar_figure(VIEWS, QUANTITIES[1], 2) is None
    assert bar_figure(VIEWS[:1], QUANTITIES[0], 2, VIEWS) is not None


def draw_bars(*values_px, most=10, left_out=()):
    """Figure of views with given residuals, and its bars."""
    views = [SampleResidual(k, "wrist", "board", value) for k, value in enumerate(values_px)]
    figure = bar_figure(views, QUANTITIES[0], most, [views[k] for k in left_out])
    return figure, rectangles(figure.svg, "bar")


def test_bar_heights_match_axis_labels():
    """A bar of 4 px on an axis up to 5 px is 80 % high. The middle of the axis is half of its end."""
    figure, bars = draw_bars(1.0, 4.0)
    assert figure.y == ("5 px", "2.5", "0")
    assert [round(box.bottom - box.top) for box in bars] == [20, 80]
    assert bars[0].right < bars[1].left
    assert view(figure.svg).right - bars[1].right == bars[0].left


def test_level_line_is_at_the_rms():
    """The rms of 3 and 4 px is 3.54 px, 71 % of 5 px, across the whole figure."""
    figure, _ = draw_bars(3.0, 4.0)
    (level,) = ends(figure.svg, "level")
    np.testing.assert_allclose(level, [[0, 29.29], [20, 29.29]], atol=0.01)
    assert figure.caption == "dashed: rms over the views used, 3.5 px"


def test_number_of_bars_is_limited():
    """The first of equal views are shown. The caption counts them only if some are omitted."""
    figure, bars = draw_bars(1.0, 1.0, 1.0, most=2)
    assert len(bars) == 2
    assert figure.caption.startswith("the 2 largest of 3 views; ")
    assert figure.x == ("sample 0", "1")
    assert draw_bars(1.0, 1.0, most=2)[0].caption.startswith("dashed")
    assert draw_bars(1.0)[0].x == ("sample 0",)
    assert draw_bars(1.0, 2.0, 1.0)[0].x == ("sample 0", "2")


def test_caption_omits_hidden_excluded_views():
    """An excluded view that is too small for the figure needs no explanation of its colour."""
    assert "orange" not in draw_bars(0.1, 1.0, 2.0, most=2, left_out=[0])[0].caption


def test_quantities_are_in_their_units():
    """Quantities are in pixels, millimetres and degrees; an undefined quantity has no number."""
    view_of_one = SampleResidual(1, "wrist", "board", 0.5, 2e-3, np.pi / 180)
    assert [(each.value(view_of_one), each.unit) for each in QUANTITIES] == [(0.5, "px"), (2.0, "mm"), (1.0, "deg")]
    assert QUANTITIES[1].value(VIEWS[0]) is None


def test_bar_figure_is_stretched():
    """The bars stretch with the page."""
    assert 'preserveAspectRatio="none"' in draw_bars(1.0)[0].svg
