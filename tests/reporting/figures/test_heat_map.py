"""Maps over two axes."""

from __future__ import annotations

import re

from basecal.reporting.figures.heat_map import heat_map


def test_larger_numbers_are_darker() -> None:
    """The least faintest, the greatest strongest; what is missing has no shade."""
    svg = heat_map("error", ("samples", [5, 10]), ("board", ["a", "b"]), [[1.0, 2.0], [None, 4.0]]).svg
    shades = [float(share) for share in re.findall(r'fill-opacity="([\d.]+)"', svg)]
    assert shades == sorted(shades)
    assert len(set(shades)) == 3
    assert svg.count('class="frame"') == 1


def test_long_labels_are_wrapped_and_told_whole() -> None:
    """As the label's own title; beyond two lines they are cut."""
    svg = heat_map("error", ("samples", [5]), ("board", ["w" * 50]), [[0.0]]).svg
    assert f"<title>{'w' * 50}</title>" in svg
    assert f">{'w' * 26}<tspan" in svg
    assert f">{'w' * 24}<" in svg
    cut = heat_map("error", ("samples", [5]), ("board", ["w" * 90]), [[0.0]]).svg
    assert "…</tspan>" in cut


def test_long_names_of_columns_are_within_their_column() -> None:
    """Below one another, and the drawing is higher."""
    short, long = (
        heat_map("error", ("board", [name]), ("samples", [5]), [[1.0]]).svg for name in ("a", "wide board of tags")
    )
    assert "<tspan" in long
    height = r'viewBox="0 0 [\d.]+ ([\d.]+)"'
    assert float(re.findall(height, long)[0]) >= float(re.findall(height, short)[0]) + 14
