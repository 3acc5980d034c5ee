"""Tests of the finding `not-converged`."""

from basecal.accuracy.findings.not_converged import not_converged


def test_failed_convergence_is_single_error(evidence):
    """Failed convergence is the only finding, and an error; a converged solution has none."""
    assert not_converged(evidence()) == []
    (found,) = not_converged(evidence({"converged": False}))
    assert (found.code, found.severity, found.about) == ("not-converged", "error", ())
