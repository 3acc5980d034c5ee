"""`prior-contradicted`: priors that the data contradict."""

from __future__ import annotations

import numpy as np
from scipy.special import chdtri

from basecal.accuracy.findings.evidence import Evidence
from basecal.accuracy.significance import SIGNIFICANCE
from basecal.cell import Finding
from basecal.estimation.least_squares.normal_equations import prior_residuals
from basecal.estimation.solve import Solution
from basecal.numerics.spectral import above

_LEARNT = 1e-6  # share of a prior's variance that the data take away, below which it is rounding


def prior_contradicted(of: Evidence) -> list[Finding]:
    """Warnings, see `contradicted_priors`."""
    return contradicted_priors(of.solution)


def contradicted_priors(solution: Solution) -> list[Finding]:
    """A finding for each prior that is further from the answer than chance allows, once in 10,000 times.

    The answer leaves the mean of a true prior by a normal error whose covariance is the prior's less the answer's, in
    directions of which the data say something at all. Source: Bar-Shalom et al. 2001 (normalised innovation squared).
    """
    found = []
    for residual, jacobian, where in prior_residuals(solution.problem, solution.state):
        name = next(n for n, c in solution.problem.columns.items() if c == where)
        if name in solution.problem.lenses and solution.problem.lenses[name].status == "free":
            continue  # what is known of lenses in general was not stated by anyone
        after = jacobian @ solution.covariance[where, where] @ jacobian.T / solution.noise.factor
        learnt = above(np.eye(len(residual)) - 0.5 * (after + after.T), _LEARNT)
        off = float(learnt.mahalanobis_squared(residual)) / max(solution.noise.factor, 1.0)
        if learnt.rank and off > chdtri(int(learnt.rank), SIGNIFICANCE):
            message = (
                f"the data contradict the prior of {name}: the answer is up to {np.abs(residual).max():.1f} of its "
                "sigmas away, more than chance explains; state larger sigmas or a better value, or make it free"
            )
            found.append(Finding("prior-contradicted", "warning", (name,), message))
    return found
