"""SVG by hand: numbers that are read, and round ones above what they must hold."""

from __future__ import annotations

import pytest

from basecal.reporting.svg import element, label_lines, nice_ceiling, three_digits, wrapped_label


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
