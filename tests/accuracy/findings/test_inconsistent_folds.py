"""`inconsistent-folds`: folds further apart than the covariance allows."""

from types import SimpleNamespace

import pytest

from basecal.accuracy.findings.inconsistent_folds import inconsistent_folds


def spread(is_taken=True, mean_square=9.0):
    beyond = SimpleNamespace(is_taken=is_taken)
    return SimpleNamespace(spread=SimpleNamespace(beyond_covariance=beyond, mean_square=mean_square))


@pytest.mark.parametrize("found", [False, True])
def test_beyond_chance(evidence, found):
    """With the ratio of the spread to the sigmas."""
    made = inconsistent_folds(evidence(cross_validation=spread(found)))
    assert [f.severity for f in made] == (["warning"] if found else [])
    assert not found or "spread 3.0 times as much as the sigmas predict. Multiply the sigmas by 3.0" in made[0].message


def test_robots_without_noise_are_named(evidence):
    """Noise that is not stated is the first to look at; where all is stated, it may be larger."""
    made = evidence(cross_validation=spread())
    made.solution.problem.robots = ("eye", "hand")
    assert "State the noise of eye and hand." in inconsistent_folds(made)[0].message
    made.solution.problem.stops.robot = ("hand", "hand")
    assert "State the noise of eye." in inconsistent_folds(made)[0].message
    made.solution.problem.stops.robot = ("hand", "eye")
    assert "State a larger noise of the robots." in inconsistent_folds(made)[0].message


def test_without_a_spread_nothing_is_said(evidence):
    """Nor without cross-validation."""
    assert inconsistent_folds(evidence()) == []
    assert inconsistent_folds(evidence(cross_validation=SimpleNamespace(spread=None))) == []
