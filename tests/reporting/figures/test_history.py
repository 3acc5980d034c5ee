"""The chart of what was verified."""

from __future__ import annotations

import re
from datetime import UTC, datetime, timedelta

import numpy as np

from basecal.cell import MeasuredShift, PastVerification
from basecal.reporting.figures.history import history_figure


def past(day: float, length_m: float, run: str = "r") -> PastVerification:
    """A shift of a length along x."""
    shifts = {"a_from_b": MeasuredShift(np.array([length_m, 0, 0]), np.full(3, 1e-4))}
    return PastVerification(
        datetime(2026, 1, 1, tzinfo=UTC) + timedelta(days=day), run, 4, False, 0.5, 1e-3, None, shifts
    )


def test_points_stand_by_day_and_length() -> None:
    """Days are evenly spaced, a larger shift stands higher; other runs are not drawn."""
    figure = history_figure([past(0, 9e-3, "before"), past(0, 1e-3), past(2, 2e-3), past(4, 3e-3)])
    circles = [(float(x), float(y)) for x, y in re.findall(r'<circle cx="([\d.]+)" cy="([\d.]+)"', figure.svg)]
    (x0, y0), (x1, y1), (x2, y2) = circles
    assert abs(x2 - 2 * x1 + x0) < 0.3
    assert y2 < y1 < y0
    assert "2026-01-01" in figure.caption
    assert "a_from_b" in figure.caption


def test_no_history_is_no_figure() -> None:
    assert history_figure([]) is None


def test_hours_of_one_day_are_told_apart() -> None:
    """And minutes of one hour; days where there are two and more."""
    for last, unit in ((30.0, "days"), (0.5, "hours"), (0.01, "minutes")):
        figure = history_figure([past(0, 1e-3), past(last / 2, 2e-3), past(last, 3e-3)])
        assert figure.caption.startswith(f"{unit} since 2026-01-01 00:00 UTC")
        assert len(set(re.findall(r'<circle cx="([\d.]+)"', figure.svg))) == 3
