"""Tests of the finding `better-optimum`."""

from types import SimpleNamespace

from basecal.accuracy.findings.better_optimum import better_optimum, guess_finding


def test_better_optimum_than_start_is_reported(evidence):
    """A better optimum is reported only if the answer differs from that of the start.

    Both costs are stated, that of the start first.
    """
    same = evidence()
    same.robust.solution = same.solution
    assert better_optimum(same) == []
    other = evidence({"cost": 40.5}, robust=SimpleNamespace(solution=SimpleNamespace(cost=99.25)))
    (found,) = better_optimum(other)
    assert (found.code, found.severity) == ("better-optimum", "info")
    assert "of cost 99.25. The certificate led to one of 40.5" in found.message


def test_better_closed_form_is_warning(evidence):
    """A closed form that predicts better is a warning with the ratio; the covariance covers both."""
    rival = SimpleNamespace(ratio=1.53)
    same = evidence(cross_validation=SimpleNamespace(rival=rival))
    same.robust.solution = same.solution
    (found,) = better_optimum(same)
    assert (found.code, found.severity) == ("better-optimum", "warning")
    assert "1.5 times better than the answer" in found.message


def test_misleading_guesses_are_info():
    """Misleading guesses are an info: the answer did not start from them."""
    found = guess_finding()
    assert (found.code, found.severity, found.about) == ("better-optimum", "info", ())
    assert "The answer was found without the guesses." in found.message
