"""`weak-direction`: a requested transform is observable, but uncertain."""

from __future__ import annotations

import numpy as np

from basecal.accuracy.findings.evidence import Evidence
from basecal.accuracy.phrases.robot_motion import advise_observability
from basecal.cell import Finding
from basecal.estimation.observability.motions import motions
from basecal.estimation.observability.observability import UNOBSERVABLE_SIGMA

# [rad], or share of the viewing distance: twice this sigma counts as unobservable.
_WEAK_SIGMA = UNOBSERVABLE_SIGMA / 2


def weak_directions(evidence: Evidence) -> list[Finding]:
    """A warning if 1 sigma of a requested transform is above 0.15 rad or 0.15 of the viewing distance on an axis."""
    found, solution = [], evidence.solution
    for name in evidence.cell.requested_transforms if solution.converged else ():
        if name in solution.observability.unobservable or name not in solution.problem.columns:
            continue
        sigma = np.sqrt(np.diag(solution.joint_transform_covariance([name])))
        sigma_m, sigma_rad = float(sigma[:3].max()), float(sigma[3:].max())
        if sigma_m > _WEAK_SIGMA * solution.observability.length_m or sigma_rad > _WEAK_SIGMA:
            do, why = advise_observability(evidence.cell, solution.problem, motions(solution.problem), (name,))
            known = f"{1e3 * sigma_m:.0f} mm and {np.degrees(sigma_rad):.1f} deg"
            what = f"One sigma of {name} is up to {known} along an axis."
            found.append(Finding("weak-direction", "warning", (name,), what, do, why))
    return found
