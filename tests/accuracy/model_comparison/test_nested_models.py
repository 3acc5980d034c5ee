"""Tests of the comparison of nested models, of which the one in use has effect size zero."""

import numpy as np
import pytest
from scipy.stats import chi2, f, norm

from basecal.accuracy.model_comparison.nested_models import (
    FALSE_DISCOVERY_RATE,
    SINGLE_LEVEL,
    Decision,
    compare_evidence,
    compare_likelihoods,
    compare_nested_models,
    compare_places,
    compare_split,
    decide,
    discoveries,
    equally_likely,
    largest_posterior,
    log_chance,
)


@pytest.mark.parametrize("freedoms", [1, 2, 6])
def test_log_chance_is_chi_square(freedoms):
    """The log chance equals SciPy's chi-square, and the exact tail within one if that underflows.

    Zero without freedoms.
    """
    for statistic in (0.0, 3.0, 80.0, 1300.0):
        assert log_chance(statistic, freedoms) == pytest.approx(chi2.logsf(statistic, freedoms), rel=1e-9)
    for statistic in (1500.0, 1e5):
        half = statistic / 2
        exact = {
            1: np.log(2) + norm.logsf(np.sqrt(statistic)),
            2: -half,
            6: -half + np.log(1 + half + half**2 / 2),
        }
        assert log_chance(statistic, freedoms) == pytest.approx(exact[freedoms], abs=1.0)
    assert log_chance(80.0, 0) == 0.0


def test_far_tail_of_many_freedoms_is_small():
    """The log chance continues to decrease if the chance underflows."""
    assert log_chance(1480.0, 200) == pytest.approx(chi2.logsf(1480.0, 200), rel=1e-2)
    assert log_chance(3900.0, 900) < log_chance(2000.0, 200) < log_chance(1480.0, 200) < -400


@pytest.mark.parametrize("noise_freedoms", [5, 40])
def test_estimated_noise_increases_chance(noise_freedoms):
    """With estimated noise the chance follows Fisher's distribution and is larger; without freedoms it is one."""
    assert log_chance(30.0, 3, noise_freedoms) == pytest.approx(f.logsf(10.0, 3, noise_freedoms), rel=1e-9)
    assert log_chance(30.0, 3, noise_freedoms) > log_chance(30.0, 3)
    assert log_chance(30.0, 0, noise_freedoms) == 0.0


@pytest.mark.parametrize(("share", "taken"), [(0.9, True), (1.1, False)])
@pytest.mark.parametrize("noise_freedoms", [np.inf, 20.0])
def test_wider_model_is_taken_below_level(share, taken, noise_freedoms):
    """A wider model is taken below the given level, or that of a single test."""
    of_noise = np.isfinite(noise_freedoms)
    gain = 4 * f.isf(share * SINGLE_LEVEL, 4, noise_freedoms) if of_noise else chi2.isf(share * SINGLE_LEVEL, 4)
    found = compare_nested_models(gain, 4, noise_freedoms=noise_freedoms)
    assert (found.gain, found.is_taken) == (gain, taken)
    assert found.chance == pytest.approx(share * SINGLE_LEVEL)
    assert compare_nested_models(gain, 4, 2 * SINGLE_LEVEL, noise_freedoms).is_taken


@pytest.mark.parametrize(("gain", "taken"), [(9.9, False), (10.1, True)])
def test_strong_evidence_is_taken(gain, taken):
    """The chance of an evidence ratio is bounded by its inverse (Markov's inequality)."""
    found = compare_evidence(gain)
    assert found.is_taken == taken
    assert found.chance == pytest.approx(np.exp(-gain / 2))


@pytest.mark.parametrize(("chances", "found"), [
    ([0.9e-3], [True]), ([1.1e-3], [False]), ([1.9e-3, 1.9e-3], [True, True]), ([1.9e-3, 2.1e-3], [False, False]),
    ([0.5, 2.9e-3, 1e-9, 1.9e-3], [False, True, True, True]), ([], []),
])  # fmt: skip
def test_false_discovery_rate_is_one_percent(chances, found):
    """One discovery in a hundred may be false.

    In a family of ten the first counts at one thousandth, two at two each; a significant one includes those before it.
    """
    np.testing.assert_array_equal(discoveries(np.log(chances).tolist(), 10, 0.01), found)


@pytest.mark.journey
@pytest.mark.parametrize("share", [0.01, FALSE_DISCOVERY_RATE])
def test_false_alarm_rate_of_families_matches_level(share):
    """Without effects, the share of families of twelve uniform tests with a discovery is the level.

    The tolerance is three standard errors.
    """
    rng = np.random.default_rng(0)
    alarms = np.mean([discoveries(np.log(rng.random(12)).tolist(), 12, share).any() for _ in range(20_000)])
    assert alarms == pytest.approx(share, abs=3 * np.sqrt(share / 20_000))


def test_explanations_are_equal_within_e_cubed():
    """Explanations are equally likely within e^3, by costs of twice the log likelihood, in the given order."""
    assert equally_likely([12.0, 7.1, 5.9, 11.8, 30.0]) == [1, 2, 3]
    assert equally_likely([]) == []


def test_largest_posterior_matches_published_table():
    """The posterior starts from one half and rises to one, with the odds of Sellke, Bayarri and Berger's table."""
    assert largest_posterior(0.0) == largest_posterior(-1.0) == pytest.approx(0.5)
    # Their bounds of the probability of the null model at p of 0.05, 0.01 and 0.001: 0.289, 0.111 and 0.0184.
    for chance, null in ((0.05, 0.289), (0.01, 0.111), (0.001, 0.0184)):
        assert 1 - largest_posterior(np.log(chance)) == pytest.approx(null, abs=6e-4)
    assert largest_posterior(-1000.0) == 1.0


@pytest.mark.parametrize(
    ("ratios", "is_taken"),
    [([5.0], True), ([3.0], False), ([5.0, -50.0, -50.0, -50.0], False), ([6.0, 4.0, -50.0], True)],
)
def test_rival_is_taken_by_mean_ratio(ratios: list[float], is_taken: bool) -> None:
    """A rival is taken if it is fifty times likelier on average over the open values."""
    assert compare_likelihoods(np.array(ratios)).is_taken == is_taken


def test_gain_is_that_of_best_value() -> None:
    """The gain is twice the log ratio of the best value."""
    assert compare_likelihoods(np.array([1.0, 6.0])).gain == 12.0


@pytest.mark.parametrize(
    ("count", "ratio", "is_taken"), [(12, 0.1, True), (12, 0.5, False), (60, 0.4, True), (60, 0.7, False)]
)
def test_split_is_taken_by_remaining_squares(count: int, ratio: float, is_taken: bool) -> None:
    """Two means are taken by the squares that they leave, beyond the number of possible splits.

    The best split of one normal leaves about four fifths of three numbers.
    """
    assert compare_split(ratio, count, 3).is_taken == is_taken


def test_best_split_of_one_mean_is_rejected() -> None:
    """The best split of 200 sets of ten items of one mean, along an axis, is never taken."""
    rng = np.random.default_rng(1)
    for _ in range(200):
        items = rng.standard_normal((10, 3))
        items = items[np.argsort(items[:, 0])]
        left = min(
            sum(float(np.sum((side - side.mean(0)) ** 2)) for side in (items[:k], items[k:])) for k in range(3, 8)
        )
        found = compare_split(left / float(np.sum((items - items.mean(0)) ** 2)), 10, 3)
        assert not found.is_taken
        assert found.log_chance > np.log(1e-3)


def test_split_without_remainder_is_taken() -> None:
    """Two means without a remainder are certain, with a finite chance."""
    assert compare_split(0.0, 8, 3).is_taken


@pytest.mark.parametrize(("sigma_m", "is_taken"), [(0.001, True), (0.02, True), (0.15, False), (2.0, False)])
def test_evidence_of_all_axes_excludes_copy(sigma_m: float, is_taken: bool) -> None:
    """Evidence of all axes to two centimetres excludes a copy, to 15 cm it does not."""
    assert compare_places(np.full(3, 0.5 * sigma_m), sigma_m**2 * np.eye(3)).is_taken is is_taken


def test_single_distance_must_be_precise() -> None:
    """Along one axis 2 mm exclude a copy, 5 mm do not."""
    for sigma_m, is_taken in ((0.002, True), (0.005, False)):
        assert compare_places(np.zeros(3), np.diag([sigma_m, 10.0, 10.0]) ** 2).is_taken is is_taken


@pytest.mark.journey
def test_distant_copies_rarely_pass() -> None:
    """At most one in 150 wrong estimates in a room of a cubic metre passes, whatever the sigma."""
    rng = np.random.default_rng(0)
    for sigma_m in (0.01, 0.05, 0.1):
        apart = rng.uniform(-0.5, 0.5, (4000, 3))
        passed = [compare_places(each, sigma_m**2 * np.eye(3)).is_taken for each in apart]
        assert np.mean(passed) < 1 / 150


def test_negative_gain_keeps_model() -> None:
    """A gain far below zero keeps the model, however large its log chance."""
    found = decide(-1e4, 5e3, 0.01, 0.05)
    assert (found.decision, found.chance) == (Decision.KEEP, 1.0)


def test_split_has_fishers_chance_of_all_splits() -> None:
    """The chance of a split is Fisher's of squares gained over left, times the number of splits into two sides."""
    found = compare_split(0.25, 12, 3)
    assert found.gain == pytest.approx(3 * 30)
    assert found.log_chance == pytest.approx(f.logsf(30.0, 3, 30) + 11 * np.log(2))


@pytest.mark.parametrize(("tests", "found"), [(0, True), (1, True), (2, False)])
def test_single_test_counts_at_full_level(tests: int, found: bool) -> None:
    """A single test counts at the full level, each of two tests at half of it."""
    assert discoveries([np.log(0.9e-2)], tests, 0.01).tolist() == [found]
    assert discoveries([np.log(0.4e-2)], tests, 0.01).tolist() == [True]
    assert discoveries([np.log(1.1e-2)], tests, 0.01).tolist() == [False]


@pytest.mark.parametrize(
    ("log_chance", "decision"),
    [(-4.7, Decision.TAKE), (-4.5, Decision.UNDECIDED), (-3.1, Decision.UNDECIDED), (-2.9, Decision.KEEP)],
)
def test_chances_between_levels_are_undecided(log_chance: float, decision: Decision) -> None:
    """A chance below 1 % takes the rival, above 5 % rejects it, and between is undecided.

    Without a second level none is.
    """
    found = decide(3.0, log_chance, 0.01, 0.05)
    assert (found.decision, found.is_taken) == (decision, decision is Decision.TAKE)
    assert decide(3.0, log_chance, 0.01).decision in {Decision.TAKE, Decision.KEEP}


def test_evidence_of_place_is_its_density() -> None:
    """The evidence of one place is its density over that of a cubic metre, along axes narrower than the room."""
    sigma, offset = np.array([0.01, 0.02, 5.0]), np.array([0.005, -0.03, 1.0])
    found = compare_places(offset, np.diag(sigma**2))
    width = 1 / (np.sqrt(2 * np.pi) * sigma[:2])
    assert found.gain == pytest.approx(2 * np.log(width).sum() - np.sum((offset / sigma) ** 2))


def test_averaged_ratio_has_inverse_as_chance() -> None:
    """The chance of an averaged ratio over all open values is its inverse."""
    found = compare_likelihoods(np.log([1.0, 3.0, 8.0]))
    assert found.chance == pytest.approx(1 / 4)
    assert found.gain == pytest.approx(2 * np.log(8))
