"""Residuals as a histogram."""

from __future__ import annotations

import re

import numpy as np

from basecal.accuracy.residuals.point_residuals import PointResiduals
from basecal.reporting.figures.histogram import histogram


def residuals(off_px: np.ndarray, used: np.ndarray) -> PointResiduals:
    count = len(off_px)
    zeros = np.zeros(count, dtype=np.int64)
    return PointResiduals("wrist", "board", zeros, zeros, np.zeros((count, 2)), off_px, used)


def test_all_coordinates_of_used_points_are_counted() -> None:
    """Bars add up to them; those beyond the ends stand in the outermost, and it is said."""
    off = np.random.default_rng(0).normal(0, 0.2, (500, 2))
    off[0] = 100.0
    used = np.arange(500) > 9
    used[0] = True
    figure = histogram([residuals(off, used)])
    counts = [int(text) for text in re.findall(r" px: (\d+)<", figure.svg)]
    assert sum(counts) == 2 * 491
    assert "982 coordinates" in figure.caption
    assert "2 beyond the ends" in figure.caption
    assert figure.x[2] == "0"
    assert float(figure.x[0]) == -float(figure.x[4].removesuffix(" px"))


def test_residuals_of_nothing() -> None:
    """Exact data have no spread, and still a figure."""
    figure = histogram([residuals(np.zeros((4, 2)), np.ones(4, dtype=bool))])
    assert "8 coordinates" in figure.caption
    assert "NaN" not in figure.svg.replace("nan", "NaN")
