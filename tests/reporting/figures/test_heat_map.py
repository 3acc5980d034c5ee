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


def test_long_labels_are_cut_and_told_whole() -> None:
    """As the label's own title."""
    svg = heat_map("error", ("samples", [5]), ("board", ["w" * 50]), [[0.0]]).svg
    assert f"<title>{'w' * 50}</title>" in svg
    assert f">{'w' * 31}…<" in svg
