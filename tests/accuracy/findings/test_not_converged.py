"""`not-converged`."""

from basecal.accuracy.findings.not_converged import not_converged


def test_only_where_the_solver_did_not_converge(evidence):
    """An error then, and nothing else."""
    assert not_converged(evidence()) == []
    (found,) = not_converged(evidence({"converged": False}))
    assert (found.code, found.severity, found.about) == ("not-converged", "error", ())
