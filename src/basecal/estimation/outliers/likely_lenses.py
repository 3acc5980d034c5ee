"""Estimation of stated lenses whose errors are larger than those of a usual calibration.

The thresholds are validated by `benchmarks.rescues`.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from basecal.cell import Cell, Intrinsics
from basecal.estimation.outliers.noise_and_outliers import with_noise
from basecal.estimation.outliers.robust_solve import RobustSolution
from basecal.estimation.problem.stated_lens import is_stated, likely_sigmas
from basecal.estimation.settings import Settings
from basecal.estimation.solve import Solution, solve_from

_ALTERNATIONS = 4  # maximum number of alternations of lens errors and noise; two usually suffice
_SETTLED_FACTOR = 1.2  # relative change of a sigma that has no effect on the solution


def with_likely_lenses(robust: RobustSolution, cell: Cell, settings: Settings) -> RobustSolution:
    """Solve again with estimated errors of those stated lenses whose errors are larger than usual.

    The covariance is conditional on the most likely sigmas.
    """
    solution = robust.solution
    for _ in range(_ALTERNATIONS):
        wider = _wider_lenses(solution, cell)
        if not solution.converged or not wider:
            break
        solution = _solve_again(solution, {**solution.problem.lenses, **wider}, settings)
    return replace(robust, solution=replace(solution, disputed=robust.solution.disputed))


def _wider_lenses(solution: Solution, cell: Cell) -> dict[str, Intrinsics]:
    """Lenses with sigmas increased to match their errors, by camera; only lenses whose sigmas were too small."""
    wider = {}
    for name, lens in solution.problem.lenses.items():
        if not is_stated(cell.cameras[name].intrinsics) or lens.sigma is None:
            continue
        sigmas = likely_sigmas(lens, solution.state.cameras[name], solution.lens_covariance(name))
        if np.any(sigmas > _SETTLED_FACTOR * lens.sigma):
            wider[name] = replace(lens, sigma=np.maximum(sigmas, lens.sigma))
    return wider


def _solve_again(solution: Solution, lenses: dict[str, Intrinsics], settings: Settings) -> Solution:
    reopened = replace(solution.problem, lenses=lenses, held=False)
    if settings.robot_noise == "stated":
        return solve_from(reopened, solution.state, settings, solution.findings)
    solved = with_noise(replace(solution, problem=reopened), settings, guess=solution)
    return replace(solved, problem=replace(solved.problem, held=True))
