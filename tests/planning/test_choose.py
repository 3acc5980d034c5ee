"""Tests of the choice among candidates, against matrix inverses and exhaustive search."""

from __future__ import annotations

from itertools import combinations, islice

import numpy as np
import pytest

from basecal.planning import choose
from basecal.planning.choose import choose_fewest, exchange, gains, greedy_choices, with_sample, without_sample


@pytest.fixture
def problem():
    """Roots (n, p, q), a covariance and a weight of two directions."""
    rng = np.random.default_rng(3)
    roots, start, ahead = rng.standard_normal((14, 8, 3)), rng.standard_normal((8, 8)), rng.standard_normal((8, 2))
    return roots, start @ start.T + np.eye(8), ahead @ ahead.T


def criterion(roots, covariance, weight, chosen) -> float:
    """Criterion computed by the explicit inverse."""
    information = np.linalg.inv(covariance) + sum((roots[k] @ roots[k].T for k in chosen), start=np.zeros((8, 8)))
    return float(np.trace(weight @ np.linalg.inv(information)))


def test_gains_match_explicit_inverse(problem):
    """The gain of each single candidate equals the one by the explicit inverse."""
    roots, covariance, weight = problem
    of_each = [criterion(*problem, []) - criterion(*problem, [k]) for k in range(len(roots))]
    np.testing.assert_allclose(gains(roots, covariance, weight), of_each, rtol=1e-10)


def test_removing_a_sample_inverts_adding(problem):
    """Removing a sample restores the covariance from before its addition."""
    roots, covariance, _ = problem
    np.testing.assert_allclose(without_sample(with_sample(covariance, roots[0]), roots[0]), covariance, rtol=1e-9)


def test_greedy_takes_best_sample_first(problem):
    """Each sample is taken once, the best first. The covariance after each step is that of all samples so far."""
    steps = list(greedy_choices(*problem))
    assert sorted(k for k, _ in steps) == list(range(14))
    assert steps[0][0] == np.argmin([criterion(*problem, [k]) for k in range(14)])
    for count in (1, 5, 14):
        chosen = [k for k, _ in steps[:count]]
        assert np.trace(problem[2] @ steps[count - 1][1]) == pytest.approx(criterion(*problem, chosen), rel=1e-9)


def test_exchange_is_within_one_percent_of_best(problem):
    """The exchange is within 1 % of the best of all 2,002 sets of five. Its covariance is that of the chosen set."""
    roots, _, weight = problem
    steps = list(islice(greedy_choices(*problem), 5))
    chosen, after = exchange(roots, [k for k, _ in steps], steps[-1][1], weight)
    best = min(criterion(*problem, each) for each in combinations(range(14), 5))
    assert len(set(chosen)) == 5
    assert criterion(*problem, chosen) == pytest.approx(np.trace(weight @ after), rel=1e-9)
    assert criterion(*problem, chosen) <= 1.01 * best


def test_choose_fewest_finds_smallest_set(problem):
    """No smaller set reaches the limit.

    The set is empty if the limit is met already, and has the maximal size if no set reaches it.
    """
    roots, covariance, weight = problem
    limit = 1.02 * min(criterion(*problem, each) for each in combinations(range(14), 4))
    chosen, reached = choose_fewest(roots, covariance, weight, 14, lambda c, _: bool(np.trace(weight @ c) <= limit))
    assert (len(chosen), reached) == (4, True)
    assert criterion(*problem, chosen) <= limit
    assert choose_fewest(roots, covariance, weight, 14, lambda c, _: True) == ([], True)
    tried, reached = choose_fewest(roots, covariance, weight, 3, lambda c, _: False)
    assert (len(tried), reached) == (3, False)


def test_exchange_stops_after_negligible_gain(problem, monkeypatch):
    """At most three passes are made. An optimal set takes a single pass without exchanges."""
    roots, covariance, weight = problem
    passes = []
    plain = choose.gains
    monkeypatch.setattr(choose, "gains", lambda *given: passes.append(1) or plain(*given))
    for scale in (1e-6, 1.0, 1e6):
        best = min(combinations(range(14), 2), key=lambda each: criterion(*problem, each))
        now = covariance
        for k in best:
            now = with_sample(now, roots[k])
        passes.clear()
        chosen, after = exchange(roots, list(best), now, scale * weight)
        assert (chosen, len(passes)) == (list(best), 2)
        np.testing.assert_allclose(after, now, rtol=1e-9)
    worst = max(combinations(range(14), 2), key=lambda each: criterion(*problem, each))
    now = covariance
    for k in worst:
        now = with_sample(now, roots[k])
    passes.clear()
    given = list(worst)
    chosen, _ = exchange(roots, given, now, weight)
    assert criterion(*problem, chosen) < criterion(*problem, worst)
    assert given == list(worst)
    assert len(passes) in {4, 6}
