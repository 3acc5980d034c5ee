"""`not-converged`: the solver did not reach an optimum."""

from __future__ import annotations

from basecal.accuracy.findings.evidence import Evidence
from basecal.cell import Finding


def not_converged(evidence: Evidence) -> list[Finding]:
    """An error if the solver did not converge."""
    if evidence.solution.converged:
        return []
    do = ("Check units and directions of the poses, or give a guess.",)
    return [Finding("not-converged", "error", (), "The solver did not converge.", do)]
