"""`prior-contradicted`: priors that the data contradict."""

from __future__ import annotations

import numpy as np

from basecal.accuracy.findings.evidence import Evidence
from basecal.accuracy.fixing.places import transform_place
from basecal.accuracy.model_comparison.nested_models import compare_nested_models
from basecal.cell import Cell, Finding, Parameters
from basecal.estimation.least_squares.normal_equations import prior_residuals
from basecal.estimation.problem.problem import Problem
from basecal.estimation.problem.stated_lens import is_stated
from basecal.estimation.solve import Solution
from basecal.geometry import Array
from basecal.numerics.spectral import Spectrum, scaled_spectrum, spectrum

# Smallest factor for sigmas that are too small, if many parameters each have a small error; assumed.
_LEAST_WIDENING = 2.0
# Share of the prior variance that the data remove, below which second-order terms are as large; assumed.
_LEARNT_SHARE = 1e-3


def prior_contradicted(evidence: Evidence) -> list[Finding]:
    """A finding for each prior whose distance from the answer has a probability below 1 in 10,000."""
    return contradicted_priors(evidence.cell, evidence.solution)


def contradicted_priors(cell: Cell, solution: Solution) -> list[Finding]:
    """A warning about each prior of a solution that the data contradict.

    The answer differs from the mean of a true prior by a normal error. Its covariance is the covariance of the prior
    minus that of the answer, in directions that the data inform. Source: Bar-Shalom et al. 2001 (normalised innovation
    squared).
    """
    found, names = [], {(each.start, each.stop): name for name, each in solution.problem.columns.items()}
    for residual, jacobian, columns in prior_residuals(solution.problem, solution.state):
        name = names[columns.start, columns.stop]
        if _is_general(cell, name):
            continue
        posterior = jacobian @ solution.observability.inverse[columns, columns] @ jacobian.T
        learnt = informed_spectrum(innovation_covariance(posterior, np.ones(len(residual))))
        off = float(learnt.squared_mahalanobis(residual)) / max(solution.noise.factor, 1.0)
        if compare_nested_models(off, int(learnt.rank)).is_taken:
            found.append(_make_finding(cell, solution.problem, name, float(np.abs(residual).max())))
    return found


def _is_general(cell: Cell, name: str) -> bool:
    """Whether a prior is the general one for lenses of its kind, instead of stated for this lens."""
    lens = cell.cameras[name].intrinsics if name in cell.cameras else None
    return lens is not None and (lens.status == "free" or is_stated(lens))


def _make_finding(cell: Cell, problem: Problem, name: str, sigmas: float) -> Finding:
    """Finding about the prior of a transform, of the lens of a camera, or of one kind of robot parameters."""
    about, subject = name, f"the lens of {name}" if name in cell.cameras else name
    do: tuple[str, ...] = ("State larger sigmas or a better value, or make it free.",)
    if name in cell.cameras or transform_place(cell, name) is not None:
        do += ("`basecal fix CELL` makes it free.",)
    for robot, model in problem.models.items():
        if kind := model.names.get(name):
            about, subject = robot, f"{kind} of {robot}"
            do = (f"Write {_wider_entry(kind, model.stated[kind], sigmas)} at {robot} in cell.yaml.",)
    what = f"The answer is up to {sigmas:.1f} sigmas away from the prior of {subject}."
    return Finding("prior-contradicted", "warning", (about,), what, do, "That is more than chance explains.")


def _wider_entry(kind: str, parameters: Parameters, sigmas: float) -> str:
    """Entry of parameters in `cell.yaml` with sigmas wide enough for a value that is `sigmas` sigmas away."""
    factor = max(_LEAST_WIDENING, np.ceil(sigmas))
    fields = parameters.model_dump(exclude_defaults=True)
    wider = {key: float(f"{factor * value:.2g}") if key.startswith("sigma") else value for key, value in fields.items()}
    return f"`{kind}: {{{', '.join(f'{key}: {value}' for key, value in wider.items())}}}`"


def innovation_covariance(covariance: Array, wider: Array) -> Array:
    """Covariance of the estimate about the mean of unit priors, (k, k), also if wider priors are in use.

    P is the information of the data, C the covariance under the priors in use. The estimate is C P d for data d with
    covariance I + P^-1. The covariance of the estimate is C (P + P P) C, which is I - C for the priors as stated.

    Args:
        covariance: C, (k, k).
        wider: (k,) sigmas of the priors in use.
    """
    if np.all(wider == 1):
        return np.eye(len(wider)) - 0.5 * (covariance + covariance.T)
    information = spectrum(covariance).inverse - np.diag(wider**-2.0)
    learnt = covariance @ (information + information @ information) @ covariance
    return 0.5 * (learnt + learnt.T)


def informed_spectrum(covariance: Array) -> Spectrum:
    """Spectrum of an innovation covariance in the directions that the data inform."""
    return scaled_spectrum(covariance, _LEARNT_SHARE)
