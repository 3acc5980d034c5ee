"""Tests of the chart of past verifications."""

from __future__ import annotations

import re
from dataclasses import replace
from datetime import UTC, datetime, timedelta

import numpy as np
from tests.drawings import ends, labels

from basecal.cell import MeasuredShift, PastVerification
from basecal.reporting.figures.history import history_figure
from basecal.reporting.svg import Figure


def past(day: float, length_m: float, run: str = "r") -> PastVerification:
    """Past verification with a shift along x."""
    shifts = {"a_from_b": MeasuredShift(np.array([length_m, 0, 0]), np.full(3, 1e-4))}
    return PastVerification(
        datetime(2026, 1, 1, tzinfo=UTC) + timedelta(days=day), run, 4, False, 0.5, 1e-3, None, shifts
    )


def test_points_are_at_day_and_length() -> None:
    """Days are evenly spaced, and a larger shift is higher. Other runs are not drawn."""
    figure = history_figure(
        [past(0, 9e-3, "before"), past(0, 8e-3, "before"), past(0, 1e-3), past(2, 2e-3), past(4, 3e-3)]
    )
    circles = [(float(x), float(y)) for x, y in re.findall(r'<circle cx="([\d.]+)" cy="([\d.]+)"', figure.svg)]
    (x0, y0), (x1, y1), (x2, y2) = circles
    assert abs(x2 - 2 * x1 + x0) < 0.3
    assert y2 < y1 < y0
    assert "2026-01-01" in figure.caption
    assert "a_from_b" in figure.caption


def test_empty_history_has_no_figure() -> None:
    assert history_figure([]) is None


def test_time_unit_depends_on_the_span() -> None:
    """Hours of one day and minutes of one hour are distinguished; a span of two days or more is in days."""
    for last, unit in ((30.0, "days"), (0.5, "hours"), (0.01, "minutes")):
        figure = history_figure([past(0, 1e-3), past(last / 2, 2e-3), past(last, 3e-3)])
        assert figure.caption.startswith(f"{unit} since 2026-01-01 00:00 UTC")
        assert len(set(re.findall(r'<circle cx="([\d.]+)"', figure.svg))) == 3


def heights(figure: Figure) -> list[float]:
    """Both ends of the first whisker [mm], by the labels of the axis."""
    foot, tip = ends(figure.svg, "whisker")[0]
    upwards = [(float(box.text), (box.top + box.bottom) / 2) for box in labels(figure.svg) if box.right < 62]
    (low, y_low), (high, y_high) = upwards[0], upwards[-1]
    scale = (high - low) / (y_high - y_low)
    return [low + (y - y_low) * scale for y in (foot[1], tip[1])]


def test_whiskers_are_two_sigma_and_not_negative() -> None:
    """A shift of 1 mm with 0.1 mm per axis reaches from 0.8 to 1.2 mm; one of 0.1 mm begins at zero."""
    figure = history_figure([past(0, 1e-3), past(2, 1.1e-3)])
    np.testing.assert_allclose(heights(figure), [0.8, 1.2], atol=0.02)
    near = history_figure([past(0, 1e-4), past(2, 1e-3)])
    np.testing.assert_allclose(heights(near), [0.0, 0.3], atol=0.02)
    assert "with 2 sigma; a_from_b" in near.caption


def test_time_unit_is_used_at_least_twice() -> None:
    """Two days are in days, less are in hours; two hours are in hours, less are in minutes."""
    for last, unit in ((2.0, "days"), (1.99, "hours"), (2 / 24, "hours"), (1.99 / 24, "minutes"), (1e-3, "minutes")):
        assert history_figure([past(0, 1e-3), past(last, 2e-3)]).caption.startswith(f"{unit} since")


def test_times_are_rounded_by_magnitude() -> None:
    """Times are rounded to hundredths up to ten, and to tenths beyond."""
    for last, text in ((9.876, "9.88"), (10.876, "10.9")):
        svg = history_figure([past(0, 1e-3), past(last, 2e-3)]).svg
        assert f"<title>days {text}: " in svg
    assert "<title>minutes 90.0: " in history_figure([past(0, 1e-3), past(1.5 / 24, 2e-3)]).svg


def test_number_of_points_and_lines_is_limited() -> None:
    """Forty of fifty verifications are drawn.

    A transform without a shift in a verification has a gap, and a seventh transform has no line.
    """
    figure = history_figure([past(k, 1e-3) for k in range(50)])
    assert figure.svg.count("<circle") == 40
    assert figure.caption.startswith("days since 2026-01-11 ")
    first = past(0, 1e-3)
    many = replace(first, shifts={f"t{k}": first.shifts["a_from_b"] for k in range(7)})
    figure = history_figure([many, replace(many, when=many.when + timedelta(days=3), shifts={})])
    assert figure.svg.count("<circle") == 6
    assert figure.caption.endswith("; t0, t1, t2, t3, t4, t5")
