"""Tests of heat maps over two axes."""

from __future__ import annotations

import re

from tests.drawings import check_labels, labels, rectangles, view

from basecal.reporting.figures.heat_map import heat_map
from basecal.reporting.svg import FAINTEST


def test_larger_numbers_are_darker() -> None:
    """The smallest number is the faintest and the largest the darkest; a missing number has no shade."""
    svg = heat_map("error", ("samples", [5, 10]), ("board", ["a", "b"]), [[1.0, 2.0], [None, 4.0]]).svg
    shades = [float(share) for share in re.findall(r'fill-opacity="([\d.]+)"', svg)]
    assert shades == sorted(shades)
    assert len(set(shades)) == 3
    assert svg.count('class="frame"') == 1


def test_long_row_labels_are_wrapped() -> None:
    """A wrapped label has its whole text as title; beyond two lines it is cut."""
    svg = heat_map("error", ("samples", [5]), ("board", ["w" * 50]), [[0.0]]).svg
    assert f"<title>{'w' * 50}</title>" in svg
    assert f">{'w' * 26}<tspan" in svg
    assert f">{'w' * 24}<" in svg
    cut = heat_map("error", ("samples", [5]), ("board", ["w" * 90]), [[0.0]]).svg
    assert "…</tspan>" in cut


def test_long_column_labels_are_wrapped() -> None:
    """The lines of a label are below one another, and the drawing is higher."""
    short, long = (
        heat_map("error", ("board", [name]), ("samples", [5]), [[1.0]]).svg for name in ("a", "wide board of tags")
    )
    assert "<tspan" in long
    height = r'viewBox="0 0 [\d.]+ ([\d.]+)"'
    assert float(re.findall(height, long)[0]) >= float(re.findall(height, short)[0]) + 14


LONG, WIDE = "a board of tags with large squares", "a wide board of small circles"


def test_labels_are_beside_their_tiles() -> None:
    """Names of rows are at the left of their tiles, those of columns below them. Every label is readable."""
    values = [[1.0, 2.0, 123.0], [None, 0.0, 4.0]]
    svg = heat_map("error", ("samples", [5.0, 0.25, WIDE]), ("board", [LONG, "b"]), values).svg
    check_labels(svg)
    named = {box.text.replace(" ", ""): box for box in labels(svg)}
    boxes = sorted([*rectangles(svg, "tile"), *rectangles(svg, "frame")], key=lambda box: (box.top, box.left))
    assert len(boxes) == 6
    for k, name in enumerate((LONG, "b")):
        row = named[name.replace(" ", "")]
        assert row.right < boxes[3 * k].left < row.right + 12
        assert row.top > boxes[3 * k].top - 1
        assert row.bottom < boxes[3 * k].bottom + 1
    for k, name in enumerate(("5", "0.25", WIDE)):
        column = named[name.replace(" ", "")]
        assert (column.left + column.right) / 2 == (boxes[k].left + boxes[k].right) / 2
        assert boxes[3].bottom < column.top < boxes[3].bottom + 12


def test_tiles_are_adjacent_with_centred_numbers() -> None:
    """Tiles touch their neighbours without overlap, and each has its number in its centre."""
    svg = heat_map("error", ("samples", [5, 10]), ("board", ["a", "b"]), [[1.0, 2.0], [3.0, 4.0]]).svg
    one, right, below, last = rectangles(svg, "tile")
    assert (one.right, one.bottom) == (right.left, below.top)
    assert (last.left, last.top) == (right.left, below.top)
    for box, number in zip((one, right, below, last), ("1.0", "2.0", "3.0", "4.0"), strict=True):
        (label,) = (each for each in labels(svg) if each.text == number)
        assert (label.left + label.right) / 2 == (box.left + box.right) / 2
        assert abs(label.top + label.bottom - box.top - box.bottom) < 4


def test_shades_are_logarithmic_and_not_full() -> None:
    """From 0.1 to 10 the middle shade is that of 1. The darkest shade is below full, and equal numbers are faint."""
    svg = heat_map("error", ("samples", [1, 2, 3]), ("board", ["a"]), [[0.1, 1.0, 10.0]]).svg
    low, middle, high = (float(box.text) for box in rectangles(svg, "tile"))
    assert low == FAINTEST
    assert abs(middle - (low + high) / 2) < 0.011
    assert 0.7 < high < 0.9
    equal = heat_map("error", ("samples", [1, 2]), ("board", ["a"]), [[2.0, 2.0]]).svg
    assert {box.text for box in rectangles(equal, "tile")} == {f"{FAINTEST}"}


def test_zero_and_missing_numbers_have_frames() -> None:
    """Zero is shown without a shade, and a missing number is a dash. Neither changes the shades of others."""
    svg = heat_map("error", ("samples", [1, 2, 3]), ("board", ["a"]), [[0.0, None, 0.5]]).svg
    assert [label.text for label in labels(svg)][:3] == ["0", "-", "0.50"]
    assert len(rectangles(svg, "frame")) == 2
    assert [box.text for box in rectangles(svg, "tile")] == [f"{FAINTEST}"]


def test_drawing_has_narrow_margins() -> None:
    """The margins beside the tiles and below the last line of labels are below 20 px, for any number of lines."""
    for name in ("a", WIDE):
        svg = heat_map("error", ("samples", [name]), ("board", ["b"]), [[1.0]]).svg
        (box,) = rectangles(svg, "tile")
        whole = view(svg)
        assert box.top < 20
        assert 0 < whole.right - box.right < 20
        assert 0 < whole.bottom - max(label.bottom for label in labels(svg)) < 20
