"""Tests of SVG elements: numbers, labels, bars, tiles and drawings."""

from __future__ import annotations

import re

import numpy as np
import pytest

from basecal.reporting.svg import (
    BAR,
    FAINTEST,
    HEIGHT,
    bar,
    dots,
    drawing,
    element,
    label_lines,
    nice_ceiling,
    segments,
    three_digits,
    tile,
    wrapped_label,
)


@pytest.mark.parametrize(
    ("value", "shown"),
    [(6412.0, "6,410"), (6400.0, "6,400"), (12.345, "12.3"), (0.25, "0.25"), (1234567.0, "1,230,000")],
)
def test_numbers_are_written_without_exponents(value, shown):
    """Numbers have three significant digits, and thousands are separated by commas."""
    assert three_digits(value) == shown


def test_labels_are_wrapped():
    """Labels are wrapped by words, and within a word that is longer than a line.

    Excess text is cut, and the whole text is the title.
    """
    svg = _wrapped("board of <6> tags", 8)
    assert svg.startswith(
        '<text class="tick" x="3.0" y="4.0" text-anchor="end"><title>board of &lt;6&gt; tags</title>board of'
    )
    assert '<tspan x="3.0" dy="1.15em">&lt;6&gt; tags</tspan></text>' in svg
    assert ">abcd<tspan" in _wrapped("abcdef", 4)
    assert svg.count("<tspan") == 1
    assert ">a b…</text>" in _wrapped("a b c d e f", 4, 1)
    assert "></text>" in _wrapped("", 4)


@pytest.mark.parametrize(("value", "above"), [(0.3, 0.5), (1.0, 1.0), (2.1, 2.5), (70.0, 100.0), (0.0, 1.0)])
def test_nice_ceiling_is_next_round_number(value, above):
    """The ceiling of a value is the next of 1, 2, 2.5 and 5 in its decade."""
    assert nice_ceiling(value) == pytest.approx(above)


def test_text_is_escaped_and_elements_are_kept() -> None:
    """Text, titles and attributes of an element are escaped, child elements are not. Fractions have one decimal."""
    inside = element("b", "<i>", title="a < b")
    assert element("g", inside, "&", class_='"', x=1.26, y=2, z=None) == (
        '<g class="&#34;" x="1.3" y="2"><b><title>a &lt; b</title>&lt;i&gt;</b>&amp;</g>'
    )


def _wrapped(label: str, *most: int) -> str:
    return wrapped_label(label, label_lines(label, *most), (3.0, 4.0), "end")


@pytest.mark.parametrize(("share", "height"), [(0.5, 0.5 * HEIGHT), (3.0, HEIGHT), (0.0, 0.5)])
def test_bar_height_is_limited_to_the_figure(share: float, height: float) -> None:
    """A bar begins at the ground line and ends at the top of the figure at most; a bar of zero is still visible."""
    drawn = bar(20.0, BAR, share, "x", 7, "view")
    found = re.search(r'class="bar".* y="([\d.]+)" width="9.0" height="([\d.]+)"', drawn)
    assert found is not None
    assert float(found[2]) == height
    assert float(found[1]) + float(found[2]) == HEIGHT


def test_bar_is_clickable_over_its_column() -> None:
    """The whole column of a bar can be clicked, and its label is escaped."""
    drawn = bar(0.0, BAR, 0.5, "a < b", 7, "view stranger")
    assert 'data-sample="7"' in drawn
    assert 'class="view stranger"' in drawn
    assert f'class="hit" x="0.0" y="0.0" width="{BAR:.1f}" height="{HEIGHT:.1f}"' in drawn
    assert "a &lt; b" in drawn


def test_faintest_tile_is_visible() -> None:
    """The opacity of tiles ranges from the faintest to full, so that the least value differs from no tile.

    A tile without text has no title.
    """
    shades = [float(re.findall(r'fill-opacity="([0-9.]+)"', tile((0, 0, 1, 1), share))[0]) for share in (0.0, 0.5, 1.0)]
    assert shades == [FAINTEST, (1 + FAINTEST) / 2, 1.0]
    assert "<title>a &lt; b</title>" in tile((0, 0, 1, 1), 0.5, "a < b")
    assert "<title>" not in tile((0, 0, 1, 1), 0.5)


def test_drawing_keeps_aspect_ratio_unless_stretched() -> None:
    """A drawing has a text alternative and a view box, and keeps its aspect ratio unless it is stretched."""
    plain = drawing(640.0, 360.5, "a < b", "inside")
    assert 'viewBox="0 0 640 360.5"' in plain
    assert "<title>a &lt; b</title>" in plain
    assert "preserveAspectRatio" not in plain
    assert 'preserveAspectRatio="none"' in drawing(1.0, 1.0, "x", stretch=True)


def test_bar_is_centred_in_its_column() -> None:
    """A twentieth of the column's width is free on each side of a bar."""
    assert 'class="bar" x="21.0" ' in bar(20.0, 20.0, 0.5, "x", 7, "view")
    assert 'width="18.0"' in bar(20.0, 20.0, 0.5, "x", 7, "view")


def test_paths_have_one_decimal() -> None:
    """Paths of segments and dots have coordinates with one decimal."""
    assert segments([np.array([[0.0, 1.04], [2.06, 3.0]])]) == "M0.0 1.0L2.1 3.0"
    assert dots(np.array([[0.04, 1.0], [2.0, 3.06]])) == "M0.0 1.0h0M2.0 3.1h0"
    assert segments([]) == dots([]) == ""
