"""The error over samples."""

from __future__ import annotations

import re

from basecal.reporting.decision.outlook import outlook_figure

OUTLOOK = [(0, 3e-3), (10, 1.5e-3), (40, 1e-3)]


def test_points_fall_and_have_words() -> None:
    """Over the number of samples in all; the dashed line is the tolerance."""
    figure = outlook_figure(OUTLOOK, 12, 1.2e-3)
    heights = [float(found) for found in re.findall(r'cy="([0-9.]+)"', figure.svg)]
    assert heights == sorted(heights)
    limit = float(re.findall(r'class="level" d="M[0-9.]+ ([0-9.]+)H', figure.svg)[0])
    assert heights[1] < limit < heights[2]
    assert re.findall(r">(\d+)</text>", figure.svg)[-3:] == ["12", "22", "52"]
    assert figure.caption == "3.0 mm with 12, 1.0 mm with 52 samples. Dashed: the tolerance, 1.2 mm."


def test_without_a_tolerance_there_is_no_line() -> None:
    """And no word of it."""
    figure = outlook_figure(OUTLOOK, 12, None)
    assert "level" not in figure.svg
    assert "Dashed" not in figure.caption
