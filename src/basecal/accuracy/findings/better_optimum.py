"""`better-optimum`: the certificate led to an optimum of lower cost."""

from __future__ import annotations

from basecal.accuracy.findings.evidence import Evidence
from basecal.cell import Finding


def better_optimum(of: Evidence) -> list[Finding]:
    """An info where the answer is not the optimum that the start had led to."""
    if of.solution is of.robust.solution:
        return []
    message = (
        f"the start led to a local optimum of cost {of.robust.solution.cost:.6g}, the certificate to one of "
        f"{of.solution.cost:.6g}: the answer is the latter"
    )
    return [Finding("better-optimum", "info", (), message)]
