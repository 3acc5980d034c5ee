"""Noise that nobody stated and outliers, each judged by the other until they agree."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from basecal.cell import Cell
from basecal.estimation.outliers.robust_solve import RobustSolution, solve_robustly
from basecal.estimation.settings import Settings
from basecal.estimation.solve import Solution, solve_from

_PASSES = 3
# Of arms with errors of their own (belts, links, a loose base) up to 9 mm and 7 mrad are on record.
_ARM_M, _ARM_RAD = 1.2e-2, 1.2e-2


def with_noise(solution: Solution, settings: Settings) -> Solution:
    """A solution with sigmas for what states none; as it is where its views say nothing in numbers."""
    estimated = replace(settings, robot_noise="estimated")
    try:
        found = solve_from(solution.problem, solution.state, estimated, solution.findings)
    except np.linalg.LinAlgError:
        return solution
    return replace(found, disputed=solution.disputed)


def is_as_of_arms(solution: Solution) -> bool:
    """Whether the noise of robots that was estimated is such as arms in order have."""
    sigmas = list(solution.noise.robots.values())
    return solution.converged and all(s[0] < _ARM_M and s[3] < _ARM_RAD for s in sigmas) and bool(sigmas)


def solve_with_noise(cell: Cell, settings: Settings, plain: Solution, noisy: Solution) -> RobustSolution:
    """The solution of all but the gross outliers, with sigmas for what states none.

    Noise is estimated of all views first: outliers make it larger, yet stand out among the others. Where it is more
    than arms have, views are left out first as if robots were exact. What is left tells the noise again, by which all
    views are judged anew, until none changes sides.

    Args:
        cell: What exists and what is known.
        settings: How to solve.
        plain: The solution of all views as if robots that state no noise had none.
        noisy: That with noise estimated of all views.
    """
    stated = replace(settings, robot_noise="stated")
    solution = noisy
    if not is_as_of_arms(noisy):
        with settings.stage("outliers"):
            solution = with_noise(solve_robustly(plain.problem, cell, stated, plain).solution, settings)
    left_out: list[tuple[int, str, str]] = []
    for _ in range(_PASSES):
        with settings.stage("outliers"):
            held = solution.noise.held_by(plain.problem)
            # From a state that outliers have pulled aside steps may overflow; such steps are not taken.
            with np.errstate(all="ignore"):
                whole = solve_from(held, solution.state, stated, plain.findings)
            robust = solve_robustly(held, cell, stated, replace(whole, disputed=plain.disputed))
        found = [(o.sample, o.camera, o.target) for o in robust.outliers]
        if found == left_out:
            break
        left_out = found
        solution = with_noise(robust.solution, settings)
    held = replace(solution.problem, held=True)
    return replace(robust, solution=replace(solution, problem=held, disputed=robust.solution.disputed))
