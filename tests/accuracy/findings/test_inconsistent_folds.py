"""Tests of the finding `inconsistent-folds`: folds spread more than the covariance allows."""

from types import SimpleNamespace

import pytest

from basecal.accuracy.findings.inconsistent_folds import inconsistent_folds


def spread(is_taken=True, mean_square=9.0):
    beyond = SimpleNamespace(is_taken=is_taken)
    return SimpleNamespace(spread=SimpleNamespace(beyond_covariance=beyond, mean_square=mean_square))


@pytest.mark.parametrize("found", [False, True])
def test_spread_beyond_chance_is_warning(evidence, found):
    """A spread beyond chance is a warning with the ratio of the spread to the sigmas."""
    made = inconsistent_folds(evidence(cross_validation=spread(found)))
    assert [f.severity for f in made] == (["warning"] if found else [])
    assert not found or "spread 3.0 times as much as the sigmas predict. Multiply the sigmas by 3.0" in made[0].message


def test_robots_without_noise_are_named(evidence):
    """The advice names robots without noise first; if all noise is stated, it may be larger."""
    made = evidence(cross_validation=spread())
    made.solution.problem.robots = ("eye", "hand")
    assert "State the noise of eye and hand." in inconsistent_folds(made)[0].message
    made.solution.problem.stops.robot = ("hand", "hand")
    assert "State the noise of eye." in inconsistent_folds(made)[0].message
    made.solution.problem.stops.robot = ("hand", "eye")
    assert "State a larger noise of the robots." in inconsistent_folds(made)[0].message


def test_missing_spread_gives_no_finding(evidence):
    """Without a spread, or without cross-validation, there is no finding."""
    assert inconsistent_folds(evidence()) == []
    assert inconsistent_folds(evidence(cross_validation=SimpleNamespace(spread=None))) == []
