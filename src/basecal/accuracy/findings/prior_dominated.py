"""`prior-dominated`: directions of a transform that only its prior determines."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from basecal.accuracy.findings.evidence import Evidence
from basecal.accuracy.phrases.null_space import describe_null_space
from basecal.cell import Finding
from basecal.estimation.least_squares.normal_equations import linearise
from basecal.estimation.observability.null_space import separate_null_space
from basecal.estimation.observability.observability import analyse_observability, is_informed, without_priors
from basecal.estimation.solve import Solution
from basecal.numerics.spectral import scaled_spectrum

# Posterior over prior sigma: the data have at most a tenth of the prior's information, as 0.95 squared is 0.9; assumed.
_DOMINATED_RATIO = 0.95


def prior_dominated(evidence: Evidence) -> list[Finding]:
    """Infos about directions that hardly improve on a prior, with requested transforms that depend on priors alone."""
    problem, unknowns = evidence.solution.problem, evidence.solution.problem.unknowns
    priors = [n for n in problem.columns if n in unknowns and is_informed(unknowns[n])]
    cell = evidence.cell
    # Marks were measured with their plate, and a part in a clamp has any pose: touches need not improve on these.
    usual = [each.name for each in cell.targets.values() if each.on in cell.plates]
    usual += [each.name for each in cell.cameras.values() if each.kind == "clamp"]
    priors = [name for name in priors if name not in map(cell.mount_name, usual)]
    if not priors or not evidence.solution.converged:
        return []
    data_only = without_priors(problem)
    hessian = linearise(data_only, evidence.solution.state).hessian
    unobservable = analyse_observability(
        data_only, evidence.solution.state, hessian, evidence.solution.noise.factor
    ).unobservable
    prior_dependent = [
        name
        for name in evidence.cell.requested_transforms
        if name in unobservable - evidence.solution.observability.unobservable
    ]
    return [finding for name in priors for finding in _dominated_findings(evidence.solution, name, prior_dependent)]


def _dominated_findings(solution: Solution, name: str, prior_dependent: Sequence[str]) -> list[Finding]:
    """A finding if the posterior of a transform nearly equals its prior along some directions."""
    problem, columns = solution.problem, solution.problem.columns[name]
    width = columns.stop - columns.start
    sigma = np.asarray(problem.unknowns[name].sigma)[:width]
    shares = scaled_spectrum(solution.observability.inverse[columns, columns], _DOMINATED_RATIO**2, sigma)
    dominated = shares.vectors[:, shares.is_informative]
    if not dominated.shape[1]:
        return []
    vectors, scale = np.zeros((problem.width, dominated.shape[1])), np.ones(problem.width)
    vectors[columns], scale[columns] = dominated, sigma
    found = separate_null_space(problem, solution.state, vectors, scale)
    others = [n for n in prior_dependent if n != name]
    why = f"{' and '.join(others)} depend{'s' if len(others) == 1 else ''} on it." if others else ""
    what = f"The data add almost nothing to the prior of {name} in: {' and '.join(map(describe_null_space, found))}."
    return [Finding("prior-dominated", "info", (name, *others), what, why=why)]
