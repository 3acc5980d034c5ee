"""Effects of which the model in use is the special case of size zero."""

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
def test_chances_are_those_of_a_chi_square(freedoms):
    """By SciPy's logarithm; where the chance itself is no number within one of the exact tail; 0 without freedoms."""
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


def test_far_tails_of_many_freedoms_are_small():
    """The logarithm goes on where the chance is no number any more: half as far again, by so much less."""
    assert log_chance(1480.0, 200) == pytest.approx(chi2.logsf(1480.0, 200), rel=1e-2)
    assert log_chance(3900.0, 900) < log_chance(2000.0, 200) < log_chance(1480.0, 200) < -400


@pytest.mark.parametrize("noise_freedoms", [5, 40])
def test_noise_that_is_estimated_makes_larger_gains_likelier(noise_freedoms):
    """By Fisher's distribution; without freedoms nothing is surprising."""
    assert log_chance(30.0, 3, noise_freedoms) == pytest.approx(f.logsf(10.0, 3, noise_freedoms), rel=1e-9)
    assert log_chance(30.0, 3, noise_freedoms) > log_chance(30.0, 3)
    assert log_chance(30.0, 0, noise_freedoms) == 0.0


@pytest.mark.parametrize(("share", "taken"), [(0.9, True), (1.1, False)])
@pytest.mark.parametrize("noise_freedoms", [np.inf, 20.0])
def test_a_wider_model_is_taken_below_its_level(share, taken, noise_freedoms):
    """At the level that it was given, or that of a test alone."""
    of_noise = np.isfinite(noise_freedoms)
    gain = 4 * f.isf(share * SINGLE_LEVEL, 4, noise_freedoms) if of_noise else chi2.isf(share * SINGLE_LEVEL, 4)
    found = compare_nested_models(gain, 4, noise_freedoms=noise_freedoms)
    assert (found.gain, found.is_taken) == (gain, taken)
    assert found.chance == pytest.approx(share * SINGLE_LEVEL)
    assert compare_nested_models(gain, 4, 2 * SINGLE_LEVEL, noise_freedoms).is_taken


@pytest.mark.parametrize(("gain", "taken"), [(9.9, False), (10.1, True)])
def test_very_strong_evidence_is_believed(gain, taken):
    """Its inverse bounds the chance of as much: Markov's inequality."""
    found = compare_evidence(gain)
    assert found.is_taken == taken
    assert found.chance == pytest.approx(np.exp(-gain / 2))


@pytest.mark.parametrize(("chances", "found"), [
    ([0.9e-3], [True]), ([1.1e-3], [False]), ([1.9e-3, 1.9e-3], [True, True]), ([1.9e-3, 2.1e-3], [False, False]),
    ([0.5, 2.9e-3, 1e-9, 1.9e-3], [False, True, True, True]), ([], []),
])  # fmt: skip
def test_one_discovery_in_a_hundred_may_be_false(chances, found):
    """Of a family of ten the first counts at a thousandth, two at two each; one that counts counts those before it."""
    np.testing.assert_array_equal(discoveries(np.log(chances).tolist(), 10, 0.01), found)


@pytest.mark.parametrize("share", [0.01, FALSE_DISCOVERY_RATE])
def test_without_effects_so_large_a_share_of_families_has_a_discovery(share):
    """Of twelve tests that are uniform; three standard errors."""
    rng = np.random.default_rng(0)
    alarms = np.mean([discoveries(np.log(rng.random(12)).tolist(), 12, share).any() for _ in range(20_000)])
    assert alarms == pytest.approx(share, abs=3 * np.sqrt(share / 20_000))


def test_explanations_are_equal_within_e_cubed():
    """Of likelihood; by costs of twice its logarithm, in the order in which they are given."""
    assert equally_likely([12.0, 7.1, 5.9, 11.8, 30.0]) == [1, 2, 3]
    assert equally_likely([]) == []


def test_the_share_of_what_is_there_as_often_as_not():
    """Half where chance makes it easily, and rising to one; odds are those of Sellke, Bayarri and Berger's table."""
    assert largest_posterior(0.0) == largest_posterior(-1.0) == pytest.approx(0.5)
    # Their bounds of the probability of the null model at p of 0.05, 0.01 and 0.001: 0.289, 0.111 and 0.0184.
    for chance, null in ((0.05, 0.289), (0.01, 0.111), (0.001, 0.0184)):
        assert 1 - largest_posterior(np.log(chance)) == pytest.approx(null, abs=6e-4)
    assert largest_posterior(-1000.0) == 1.0


@pytest.mark.parametrize(
    ("ratios", "is_taken"),
    [([5.0], True), ([3.0], False), ([5.0, -50.0, -50.0, -50.0], False), ([6.0, 4.0, -50.0], True)],
)
def test_a_rival_is_taken_by_its_mean_ratio(ratios: list[float], is_taken: bool) -> None:
    """Fifty times likelier, on the mean over the values that are open."""
    assert compare_likelihoods(np.array(ratios)).is_taken == is_taken


def test_gain_is_that_of_the_best_value() -> None:
    """Twice the log ratio."""
    assert compare_likelihoods(np.array([1.0, 6.0])).gain == 12.0


@pytest.mark.parametrize(
    ("count", "ratio", "is_taken"), [(12, 0.1, True), (12, 0.5, False), (60, 0.4, True), (60, 0.7, False)]
)
def test_two_means_are_taken_by_what_they_leave(count: int, ratio: float, is_taken: bool) -> None:
    """Beyond the number of ways to split; the best split of one normal leaves about four fifths of three numbers."""
    assert compare_split(ratio, count, 3).is_taken == is_taken


def test_the_best_split_of_one_mean_is_not_taken() -> None:
    """200 sets of ten items, each split where it leaves least along an axis."""
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


def test_two_means_that_leave_nothing_are_certain() -> None:
    """And no chance is below what is a number."""
    assert compare_split(0.0, 8, 3).is_taken


@pytest.mark.parametrize(("sigma_m", "is_taken"), [(0.001, True), (0.02, True), (0.15, False), (2.0, False)])
def test_coarse_evidence_of_all_axes_excludes_a_copy(sigma_m: float, is_taken: bool) -> None:
    """Two centimetres do, 15 cm do not."""
    assert compare_places(np.full(3, 0.5 * sigma_m), sigma_m**2 * np.eye(3)).is_taken is is_taken


def test_a_distance_alone_has_to_be_exact() -> None:
    """Along one axis 2 mm exclude a copy, 5 mm do not."""
    for sigma_m, is_taken in ((0.002, True), (0.005, False)):
        assert compare_places(np.zeros(3), np.diag([sigma_m, 10.0, 10.0]) ** 2).is_taken is is_taken


def test_copies_that_are_seldom_near_are_seldom_taken_for_one_place() -> None:
    """Of deceived estimates anywhere in a room of a cubic metre at most one in 150 passes, whatever the sigma."""
    rng = np.random.default_rng(0)
    for sigma_m in (0.01, 0.05, 0.1):
        apart = rng.uniform(-0.5, 0.5, (4000, 3))
        passed = [compare_places(each, sigma_m**2 * np.eye(3)).is_taken for each in apart]
        assert np.mean(passed) < 1 / 150


def test_a_gain_far_below_zero_decides_nothing() -> None:
    """However large the logarithm of its chance is."""
    found = decide(-1e4, 5e3, 0.01, 0.05)
    assert (found.decision, found.chance) == (Decision.KEEP, 1.0)


def test_two_means_have_fishers_chance_of_all_splits() -> None:
    """Of the squares gained over those left, times the number of ways to split items into two sides."""
    found = compare_split(0.25, 12, 3)
    assert found.gain == pytest.approx(3 * 30)
    assert found.log_chance == pytest.approx(f.logsf(30.0, 3, 30) + 11 * np.log(2))


@pytest.mark.parametrize(("tests", "found"), [(0, True), (1, True), (2, False)])
def test_a_single_test_counts_at_the_share(tests: int, found: bool) -> None:
    """Of two tests a half of it each."""
    assert discoveries([np.log(0.9e-2)], tests, 0.01).tolist() == [found]
    assert discoveries([np.log(0.4e-2)], tests, 0.01).tolist() == [True]
    assert discoveries([np.log(1.1e-2)], tests, 0.01).tolist() == [False]


@pytest.mark.parametrize(
    ("log_chance", "decision"),
    [(-4.7, Decision.TAKE), (-4.5, Decision.UNDECIDED), (-3.1, Decision.UNDECIDED), (-2.9, Decision.KEEP)],
)
def test_chances_between_two_levels_are_undecided(log_chance: float, decision: Decision) -> None:
    """Below a hundredth the rival is taken, above a twentieth it is not; without a second level nothing is open."""
    found = decide(3.0, log_chance, 0.01, 0.05)
    assert (found.decision, found.is_taken) == (decision, decision is Decision.TAKE)
    assert decide(3.0, log_chance, 0.01).decision in {Decision.TAKE, Decision.KEEP}


def test_evidence_of_one_place_is_that_of_its_density() -> None:
    """Over that of a cubic metre, along each axis less wide than the room."""
    sigma, offset = np.array([0.01, 0.02, 5.0]), np.array([0.005, -0.03, 1.0])
    found = compare_places(offset, np.diag(sigma**2))
    width = 1 / (np.sqrt(2 * np.pi) * sigma[:2])
    assert found.gain == pytest.approx(2 * np.log(width).sum() - np.sum((offset / sigma) ** 2))


def test_a_ratio_that_is_averaged_has_its_inverse_as_chance() -> None:
    """Of all values of what is open."""
    found = compare_likelihoods(np.log([1.0, 3.0, 8.0]))
    assert found.chance == pytest.approx(1 / 4)
    assert found.gain == pytest.approx(2 * np.log(8))
