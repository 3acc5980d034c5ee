"""SVG by hand: numbers that are read, and round ones above what they must hold."""

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
def test_numbers_are_read_without_exponents(value, shown):
    """Three digits, thousands set apart."""
    assert three_digits(value) == shown


def test_labels_are_wrapped():
    """By words, and within one that is longer than a line; the rest of too many is cut; the whole is the title."""
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
def test_round_numbers_are_not_below_a_value(value, above):
    """The next of 1, 2, 2.5 and 5 in its decade."""
    assert nice_ceiling(value) == pytest.approx(above)


def test_words_in_an_element_are_escaped_and_elements_are_not() -> None:
    """Nor can an attribute or a title be markup; fractions have one decimal."""
    inside = element("b", "<i>", title="a < b")
    assert element("g", inside, "&", class_='"', x=1.26, y=2, z=None) == (
        '<g class="&#34;" x="1.3" y="2"><b><title>a &lt; b</title>&lt;i&gt;</b>&amp;</g>'
    )


def _wrapped(label: str, *most: int) -> str:
    return wrapped_label(label, label_lines(label, *most), (3.0, 4.0), "end")


@pytest.mark.parametrize(("share", "height"), [(0.5, 0.5 * HEIGHT), (3.0, HEIGHT), (0.0, 0.5)])
def test_a_bar_ends_with_the_figure(share: float, height: float) -> None:
    """It stands on the ground, and one of nothing is still to be seen."""
    drawn = bar(20.0, BAR, share, "x", 7, "view")
    found = re.search(r'class="bar".* y="([\d.]+)" width="9.0" height="([\d.]+)"', drawn)
    assert found is not None
    assert float(found[2]) == height
    assert float(found[1]) + float(found[2]) == HEIGHT


def test_a_bar_of_a_sample_can_be_chosen() -> None:
    """All of its column can be hit; its label cannot be markup."""
    drawn = bar(0.0, BAR, 0.5, "a < b", 7, "view stranger")
    assert 'data-sample="7"' in drawn
    assert 'class="view stranger"' in drawn
    assert f'class="hit" x="0.0" y="0.0" width="{BAR:.1f}" height="{HEIGHT:.1f}"' in drawn
    assert "a &lt; b" in drawn


def test_a_tile_with_least_is_told_from_none() -> None:
    """From the faintest to full; a tile without words has no title."""
    shades = [float(re.findall(r'fill-opacity="([0-9.]+)"', tile((0, 0, 1, 1), share))[0]) for share in (0.0, 0.5, 1.0)]
    assert shades == [FAINTEST, (1 + FAINTEST) / 2, 1.0]
    assert "<title>a &lt; b</title>" in tile((0, 0, 1, 1), 0.5, "a < b")
    assert "<title>" not in tile((0, 0, 1, 1), 0.5)


def test_a_drawing_keeps_its_shape_unless_it_is_stretched() -> None:
    """With a text alternative and the box of its view."""
    plain = drawing(640.0, 360.5, "a < b", "inside")
    assert 'viewBox="0 0 640 360.5"' in plain
    assert "<title>a &lt; b</title>" in plain
    assert "preserveAspectRatio" not in plain
    assert 'preserveAspectRatio="none"' in drawing(1.0, 1.0, "x", stretch=True)


def test_a_bar_stands_in_the_middle_of_its_column() -> None:
    """A twentieth of the width is free on each side."""
    assert 'class="bar" x="21.0" ' in bar(20.0, 20.0, 0.5, "x", 7, "view")
    assert 'width="18.0"' in bar(20.0, 20.0, 0.5, "x", 7, "view")


def test_lines_and_dots_are_in_tenths() -> None:
    """Of what is between two points, or at one."""
    assert segments([np.array([[0.0, 1.04], [2.06, 3.0]])]) == "M0.0 1.0L2.1 3.0"
    assert dots(np.array([[0.04, 1.0], [2.0, 3.06]])) == "M0.0 1.0h0M2.0 3.1h0"
    assert segments([]) == dots([]) == ""
