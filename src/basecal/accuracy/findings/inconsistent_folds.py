"""`inconsistent-folds`: parts of the recording give answers that differ by more than the covariance allows."""

from __future__ import annotations

import numpy as np

from basecal.accuracy.findings.evidence import Evidence
from basecal.cell import Finding


def inconsistent_folds(evidence: Evidence) -> list[Finding]:
    """A warning if the spread of the folds is significantly larger than the covariance predicts."""
    spread = None if evidence.cross_validation is None else evidence.cross_validation.spread
    if spread is None or not spread.beyond_covariance.is_taken:
        return []
    problem = evidence.solution.problem
    lacking = [robot for robot in problem.robots if robot not in problem.stops.robot]
    noise = f"State the noise of {' and '.join(lacking)}." if lacking else "State a larger noise of the robots."
    ratio = f"{np.sqrt(spread.mean_square):.1f}"
    what = f"The answers of the folds spread {ratio} times as much as the sigmas predict."
    do = f"Multiply the sigmas by {ratio}.", noise, "Look for samples that were taken while something moved."
    return [Finding("inconsistent-folds", "warning", (), what, do)]
