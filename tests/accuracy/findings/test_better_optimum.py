"""`better-optimum`."""

from types import SimpleNamespace

from basecal.accuracy.findings.better_optimum import better_optimum, guess_finding


def test_only_where_the_answer_is_another_than_the_start_led_to(evidence):
    """Both costs are told, that of the start first."""
    same = evidence()
    same.robust.solution = same.solution
    assert better_optimum(same) == []
    other = evidence({"cost": 40.5}, robust=SimpleNamespace(solution=SimpleNamespace(cost=99.25)))
    (found,) = better_optimum(other)
    assert (found.code, found.severity) == ("better-optimum", "info")
    assert "of cost 99.25. The certificate led to one of 40.5" in found.message


def test_a_closed_form_that_predicts_better_is_a_warning(evidence):
    """How many times better, and that the covariance covers both."""
    rival = SimpleNamespace(ratio=1.53)
    same = evidence(cross_validation=SimpleNamespace(rival=rival))
    same.robust.solution = same.solution
    (found,) = better_optimum(same)
    assert (found.code, found.severity) == ("better-optimum", "warning")
    assert "1.5 times better than the answer" in found.message


def test_guesses_that_led_astray_are_an_info():
    """The answer did not start from them."""
    found = guess_finding()
    assert (found.code, found.severity, found.about) == ("better-optimum", "info", ())
    assert "The answer was found without the guesses." in found.message
