"""Tests of the robust scale of squared distances with gross errors."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import chi2, f

from basecal.estimation.least_squares.studentized_residuals import MahalanobisSquared
from basecal.estimation.outliers.robust_scale import Scale, robust_scale

CHANCE = 1e-4


def make_squares(value, freedoms=6):
    value = np.asarray(value, dtype=np.float64)
    return MahalanobisSquared(value, np.full(len(value), freedoms, dtype=np.int64))


def test_stated_sigmas_are_kept(rng):
    """Deviations as large as stated, or smaller, or up to 1.5 times larger leave the scale at one."""
    clean = rng.chisquare(6, 200)
    for factor in (0.01, 1.0, 1.3**2):
        found = robust_scale([make_squares(factor * clean)], 6, True, CHANCE)
        assert (found.variance, found.freedoms) == (1.0, np.inf)
    found = robust_scale([make_squares(1.8**2 * clean)], 6, True, CHANCE)
    assert found.variance == pytest.approx(1.8**2, rel=0.2)
    assert robust_scale([make_squares(0.01 * clean)], 6, False, CHANCE).variance == pytest.approx(0.01, rel=0.2)


def test_gross_deviations_do_not_widen_the_scale(rng):
    """With a third of unstated deviations a thousand times too large, the scale is that of the others."""
    value = rng.chisquare(6, 300)
    value[:100] *= 1e3
    found = robust_scale([make_squares(value[:150]), make_squares(value[150:])], 6, False, CHANCE)
    assert found.variance == pytest.approx(1.0, rel=0.25)
    gross = found.gross_mask(make_squares(value))
    assert gross[:100].mean() > 0.95
    assert gross[100:].mean() < 0.02
    assert found.freedoms == pytest.approx(0.4 * (200 * 6 - 6), rel=0.1)


@pytest.mark.parametrize("freedoms", [1, 2, 6])
def test_stated_limit_is_chi_square(freedoms):
    """A clean deviation exceeds the limit once in ten thousand times. Without freedoms it is infinite."""
    limit = Scale(4.0, np.inf, np.inf, CHANCE).limit(np.array([freedoms, 0]))
    np.testing.assert_allclose(limit, [4.0 * chi2.isf(CHANCE, freedoms), np.inf])


def test_estimated_limit_is_fishers_f():
    """The limit is that of F for the freedoms of the scale, and wider for fewer freedoms."""
    limit = Scale(2.0, 30.0, np.inf, CHANCE).limit(np.array([6]))
    assert limit[0] == pytest.approx(2.0 * 6 * f.isf(CHANCE, 6, 30))
    uneven = Scale(2.0, 30.0, 2.0, CHANCE).limit(np.array([6]))
    assert uneven[0] == pytest.approx(2.0 * chi2.median(6) * 2 * f.isf(CHANCE, 2, 30) / chi2.median(2))


def test_uneven_noise_has_fewer_freedoms(rng):
    """Six numbers with all noise in two of them scatter like two, even ones like six."""
    for freedoms, value in ((2.0, 3.0 * rng.chisquare(2, 5000)), (6.0, rng.chisquare(6, 5000))):
        found = robust_scale([make_squares(value)], 6, False, CHANCE)
        assert np.sum(found.shape * found.weight) == pytest.approx(freedoms, abs=0.3)


def test_several_shapes_have_one_limit():
    """The chances of exceeding it, weighted by the likelihood of each shape, sum to the chance of the scale."""
    limit = Scale(2.0, 30.0, np.array([1.0, 2.0, 6.0]), CHANCE, np.array([0.1, 0.2, 0.7])).limit(np.array([6, 0, 6]))
    over_median = limit[0] / (2.0 * chi2.median(6))
    tails = [w * f.sf(over_median * chi2.median(k) / k, k, 30) for k, w in ((1, 0.1), (2, 0.2), (6, 0.7))]
    assert sum(tails) == pytest.approx(CHANCE, rel=1e-3)
    assert limit.tolist() == [limit[0], np.inf, limit[0]]


@pytest.mark.parametrize("shape", [3, 4])
def test_limit_of_twenty_squares_keeps_its_chance(rng, shape):
    """A clean square exceeds it with at most the chance of the scale. Twenty squares hardly determine the shape."""
    rows = rng.chisquare(shape, (150, 20))
    limits = [robust_scale([make_squares(row)], 12, False, CHANCE).limit(np.array([6]))[0] for row in rows]
    assert chi2.sf(limits, shape).mean() < CHANCE


def test_no_deviations_have_the_stated_scale():
    """Empty input, infinities, or deviations without freedoms give one."""
    for none in ([], [make_squares([np.inf, np.nan])], [make_squares([1.0, 2.0], 0)]):
        assert robust_scale(none, 6, False, CHANCE).variance == 1.0


def test_nan_deviations_are_not_gross():
    """A deviation that is not a number is not excluded."""
    assert Scale(1.0, np.inf, np.inf, CHANCE).gross_mask(make_squares([np.nan, 1.0, 1e6])).tolist() == [
        False,
        False,
        True,
    ]


@pytest.mark.parametrize(("times", "is_stated"), [(1.45, True), (1.55, False)])
def test_stated_sigmas_are_kept_up_to_a_factor(times, is_stated):
    """Stated sigmas are kept up to a ratio of 1.5, by the median of squares over that of chi-square.

    Beyond it the scale is that of the squares.
    """
    alike = make_squares(np.full(50, times**2 * chi2.median(6)))
    found = robust_scale([alike], 6, True, CHANCE)
    assert (found.variance, np.isinf(found.freedoms)) == (pytest.approx(1.0 if is_stated else times**2), is_stated)


@pytest.mark.parametrize(
    ("count", "unknowns", "freedoms"), [(50, 6, 0.4 * 294), (50, 40, 0.4 * 260), (1, 6, 0.4), (1, 60, 0.4)]
)
def test_freedoms_are_reduced_by_the_unknowns(count, unknowns, freedoms):
    """The median is as informative as two fifths of them, and at least one freedom remains before that."""
    found = robust_scale([make_squares(np.full(count, 3.0))], unknowns, False, CHANCE)
    assert found.freedoms == pytest.approx(freedoms)
    assert found.chance == CHANCE


def test_deviations_with_one_freedom_count():
    """Deviations with one freedom are combined with those of other freedoms, each relative to its own median."""
    of_one, of_six = make_squares(np.full(9, 4.0 * chi2.median(1)), 1), make_squares(np.full(8, 4.0 * chi2.median(6)))
    assert robust_scale([of_one], 0, False, CHANCE).variance == pytest.approx(4.0)
    found = robust_scale([of_one, of_six, make_squares([1e9, 1e9], 0)], 0, False, CHANCE)
    assert found.variance == pytest.approx(4.0)
    assert found.freedoms == pytest.approx(0.4 * (9 + 48))


def test_limit_needs_at_least_one_freedom():
    """A scale with less than one freedom has the limit of one. Exact data have a limit near zero."""
    few, one = (Scale(1.0, freedoms, np.inf, CHANCE).limit(np.array([2])) for freedoms in (0.4, 1.0))
    np.testing.assert_allclose(few, one)
    np.testing.assert_allclose(one, 2 * f.isf(CHANCE, 2, 1))
    exact = Scale(1e-9, np.inf, np.inf, CHANCE)
    assert exact.gross_mask(make_squares([np.nan, 1e-10, 0.5])).tolist() == [False, False, True]
    assert exact.limit(np.zeros(0, dtype=int)).shape == (0,)
