"""Tests of the drift over days: slopes are found, and false alarms are as rare as stated."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest
from scipy.stats import chi2

from basecal.accuracy.drift.history import FEWEST_VERIFICATIONS, drifts, record_verification
from basecal.accuracy.drift.shifts import Shift
from basecal.accuracy.drift.verify import Verification
from basecal.cell import MeasuredShift, PastVerification

START = datetime(2026, 1, 1, tzinfo=UTC)
SIGMA = np.array([1e-4, 2e-4, 3e-4])
OFFSET = np.array([4e-4, -2e-4, 1e-4])  # error of the run itself


def history(days: list[float], slope: np.ndarray, rng: np.random.Generator, run: str = "r") -> list[PastVerification]:
    """Verifications of a base that moves by a slope per day."""
    made = []
    for day in days:
        t_m = OFFSET + slope * day + SIGMA * rng.standard_normal(3)
        shifts = {"a_from_b": MeasuredShift(t_m, SIGMA)}
        made.append(PastVerification(START + timedelta(days=day), run, 4, False, 0.5, 1e-3, None, shifts))
    return made


def test_drift_is_found_with_sigma(rng: np.random.Generator) -> None:
    """The slope matches its sigma over 300 histories.

    The sum of squares over sigmas has mean 3, within 3.5 standard errors of sqrt(6 / 300).
    """
    slope, days = np.array([1e-4, 0.0, -5e-5]), [0.0, 1.0, 7.0, 8.0, 20.0]
    found = [drifts(history(days, slope, rng))[0] for _ in range(300)]
    squared = [float(np.sum(((each.m_per_day - slope) / each.sigma) ** 2)) for each in found]
    assert np.mean(squared) == pytest.approx(3.0, abs=3.5 * np.sqrt(6 / 300))
    assert np.median([each.chance for each in found]) < 1e-6


def test_chances_are_uniform_without_drift(rng: np.random.Generator) -> None:
    """Half of 300 chances are below a half, within 3.5 standard errors. The offset of the run itself is no drift."""
    chances = [drifts(history([0.0, 2.0, 3.0, 9.0], np.zeros(3), rng))[0].chance for _ in range(300)]
    assert np.mean(np.array(chances) < 0.5) == pytest.approx(0.5, abs=3.5 * np.sqrt(0.25 / 300))


def test_too_few_verifications_show_no_drift(rng: np.random.Generator) -> None:
    """An empty history, two verifications, equal times, or earlier runs show no drift."""
    assert drifts([]) == ()
    assert drifts(history([0.0, 1.0], np.zeros(3), rng)) == ()
    assert drifts(history([1.0] * FEWEST_VERIFICATIONS, np.zeros(3), rng)) == ()
    before = history([0.0, 1.0, 2.0], np.zeros(3), rng)
    assert drifts([*before, *history([3.0, 4.0], np.zeros(3), rng, "later")]) == ()


def test_verification_record_has_shifts_and_cause() -> None:
    """A record has the shifts and sigmas of each transform; the moved frame is kept only if something moved."""
    covariance = np.diag([1.0, 4.0, -1e-30, 9.0, 9.0, 9.0]) * 1e-8
    shift = Shift("hand_base", "a_from_b", None, np.arange(6.0), covariance, np.eye(6), 9.0, 6)
    found = Verification(True, 0.01, shift, (), 2e-3, (4, 7, 8), requested=(shift,))
    kept = record_verification(found, START, "r")
    assert (kept.samples, kept.moved, kept.chance, kept.detectable_m) == (3, True, 0.01, 2e-3)
    assert (kept.frame, list(kept.shifts)) == ("hand_base", ["a_from_b"])
    np.testing.assert_array_equal(kept.shifts["a_from_b"].t_m, [0.0, 1.0, 2.0])
    np.testing.assert_allclose(kept.shifts["a_from_b"].sigma_m, [1e-4, 2e-4, 0.0])
    assert record_verification(replace(found, moved=False), START, "r").frame is None
    assert record_verification(replace(found, moved=None), START, "r").frame is None
    assert record_verification(replace(found, shift=None), START, "r").frame is None


def make_verification(day: float, t_m: list[float], sigma_m: list[float]) -> PastVerification:
    shifts = {"a_from_b": MeasuredShift(np.array(t_m), np.array(sigma_m))}
    return PastVerification(START + timedelta(days=day), "r", 4, False, 0.5, 1e-3, None, shifts)


def test_drift_is_weighted_line_of_each_axis() -> None:
    """Slopes, their sigmas and the joint chance equal `np.polyfit` and the chi-square distribution."""
    rng = np.random.default_rng(2)
    days, t_m = [0.0, 2.0, 5.0, 6.0], 1e-4 * rng.standard_normal((4, 3))
    sigma = 1e-4 * rng.uniform(0.5, 2.0, (4, 3))
    (found,) = drifts([make_verification(d, t.tolist(), s.tolist()) for d, t, s in zip(days, t_m, sigma, strict=True)])
    fits = [np.polyfit(days, t_m[:, k], 1, w=1 / sigma[:, k], cov="unscaled") for k in range(3)]
    np.testing.assert_allclose(found.m_per_day, [line[0] for line, _ in fits])
    np.testing.assert_allclose(found.sigma, [np.sqrt(covariance[0, 0]) for _, covariance in fits])
    assert found.chance == pytest.approx(chi2.sf(np.sum((found.m_per_day / found.sigma) ** 2), 3))
    assert (found.transform, found.run, found.count) == ("a_from_b", "r", 4)


def test_drift_needs_three_verifications_over_time() -> None:
    """Three verifications over more than a thousandth of a day are enough; an axis without a sigma is not used."""
    minute = 1 / 1440
    sigma = [1e-4] * 3
    for minutes, is_found in ((1.3, False), (1.6, True)):
        days = (0.0, 0.5 * minutes * minute, minutes * minute)
        assert bool(drifts([make_verification(day, [0.0] * 3, sigma) for day in days])) == is_found
    exact = [make_verification(day, [0.0] * 3, [1e-4, 0.0, 1e-4]) for day in (0.0, 1.0, 2.0)]
    assert drifts(exact) == ()
