"""`prior-contradicted`: priors that the data contradict."""

from __future__ import annotations

from collections.abc import Set

import numpy as np

from basecal.accuracy.findings.evidence import Evidence
from basecal.accuracy.model_comparison.nested_models import compare_nested_models
from basecal.cell import Finding
from basecal.estimation.least_squares.normal_equations import prior_residuals
from basecal.estimation.problem.stated_lens import is_stated
from basecal.estimation.solve import Solution
from basecal.geometry import Array
from basecal.numerics.spectral import Spectrum, scaled_spectrum, spectrum

# Share of a variance that the data take away, below which second-order terms move as much; assumed.
_LEARNT_SHARE = 1e-3


def prior_contradicted(evidence: Evidence) -> list[Finding]:
    """Warnings, see `contradicted_priors`."""
    lenses = {name for name, camera in evidence.cell.cameras.items() if is_stated(camera.intrinsics)}
    return contradicted_priors(evidence.solution, lenses)


def contradicted_priors(solution: Solution, exclusions: Set[str] = frozenset()) -> list[Finding]:
    """A finding for each prior that is further from the answer than chance allows, once in 10,000 times.

    The answer differs from the mean of a true prior by a normal error. Its covariance is the prior's less the answer's,
    in directions that the data show at all. Source: Bar-Shalom et al. 2001 (normalised innovation squared).

    Args:
        solution: The solution.
        exclusions: Cameras whose lenses nobody stated a prior of.
    """
    found = []
    for residual, jacobian, where in prior_residuals(solution.problem, solution.state):
        name = next(n for n, c in solution.problem.columns.items() if c == where)
        if name in exclusions or (name in solution.problem.lenses and solution.problem.lenses[name].status == "free"):
            continue  # what is known of lenses in general was not stated by anyone
        after = jacobian @ solution.observability.inverse[where, where] @ jacobian.T
        learnt = informed_spectrum(innovation(after, np.ones(len(residual))))
        off = float(learnt.squared_mahalanobis(residual)) / max(solution.noise.factor, 1.0)
        if compare_nested_models(name, off, int(learnt.rank)).is_taken:
            what = f"The answer is up to {np.abs(residual).max():.1f} sigmas away from the prior of {name}."
            why, do = "That is more than chance explains.", ("State larger sigmas or a better value, or make it free.",)
            fix = ("`basecal fix CELL` makes it free.",) if name in solution.problem.unknowns else ()
            found.append(Finding("prior-contradicted", "warning", (name,), what, (*do, *fix), why))
    return found


def innovation(covariance: Array, wider: Array) -> Array:
    """Covariance of estimates about the mean of unit priors, (k, k), where the priors in use were so much wider.

    P is the information of the data, C the covariance under the priors in use. The estimate is C P d, of data d whose
    covariance is I + P^-1. Its own covariance is C (P + P P) C, which is I - C for the priors as stated.

    Args:
        covariance: C, (k, k).
        wider: (k,) sigmas of the priors in use.
    """
    if np.all(wider == 1):
        return np.asarray(np.eye(len(wider)) - 0.5 * (covariance + covariance.T))
    by_data = spectrum(covariance).inverse - np.diag(wider**-2.0)
    learnt = covariance @ (by_data + by_data @ by_data) @ covariance
    return np.asarray(0.5 * (learnt + learnt.T))


def informed_spectrum(gain: Array) -> Spectrum:
    """The directions of which the data say something at all."""
    return scaled_spectrum(gain, _LEARNT_SHARE)
