"""The error over samples."""

from __future__ import annotations

import re

from basecal.acquisition.watching import Sigma, Snapshot
from basecal.reporting.decision.outlook import outlook_figure, progress_figure

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


def test_the_error_of_a_capture_is_drawn_beside_its_tolerance() -> None:
    """Else the sigma of the base; one point is no line."""
    sigmas = tuple(Sigma(k, 2e-3 / k, 1e-3) for k in range(1, 6))
    assert progress_figure(Snapshot(sigmas=sigmas[:1])) is None
    alone = progress_figure(Snapshot(sigmas=sigmas))
    assert alone is not None
    assert "2.0 mm with 1, 0.40 mm with 5 samples." in alone.caption
    task = progress_figure(Snapshot(sigmas=sigmas, errors=((4, 1e-3), (5, 8e-4)), tolerance_m=5e-4))
    assert task is not None
    assert "1.0 mm with 4, 0.80 mm with 5 samples. Dashed: the tolerance, 0.5 mm." in task.caption
    assert task.svg.count('class="level"') == 1
