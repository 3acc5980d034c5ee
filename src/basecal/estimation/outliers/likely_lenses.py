"""Stated lenses that are off by more than a usual calibration, estimated with errors as large as the data show.

`benchmarks.rescues` judges its limits.
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

_ALTERNATIONS = 4  # of errors of lenses and noise in turn; two settle most
_SETTLED_FACTOR = 1.2  # factor of a sigma, which changes no answer


def with_likely_lenses(robust: RobustSolution, cell: Cell, settings: Settings) -> RobustSolution:
    """The solution with the errors of stated lenses estimated, where these are larger than usual.

    Its covariance is that at the most likely sigmas.
    """
    solution = robust.solution
    for _ in range(_ALTERNATIONS):
        wider = _wider_lenses(solution, cell)
        if not solution.converged or not wider:
            break
        solution = _solved_again(solution, {**solution.problem.lenses, **wider}, settings)
    return replace(robust, solution=replace(solution, disputed=robust.solution.disputed))


def _wider_lenses(solution: Solution, cell: Cell) -> dict[str, Intrinsics]:
    """The lenses whose errors are larger than assumed so far, by camera."""
    wider = {}
    for name, used in solution.problem.lenses.items():
        if not is_stated(cell.cameras[name].intrinsics) or used.sigma is None:
            continue
        sigmas = likely_sigmas(used, solution.state.cameras[name], solution.lens_covariance(name))
        if np.any(sigmas > _SETTLED_FACTOR * used.sigma):
            wider[name] = replace(used, sigma=np.maximum(sigmas, used.sigma))
    return wider


def _solved_again(solution: Solution, lenses: dict[str, Intrinsics], settings: Settings) -> Solution:
    opened = replace(solution.problem, lenses=lenses, held=False)
    if settings.robot_noise == "stated":
        return solve_from(opened, solution.state, settings, solution.findings)
    found = with_noise(replace(solution, problem=opened), settings, guess=solution)
    return replace(found, problem=replace(found.problem, held=True))
