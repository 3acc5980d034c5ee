"""Alternating estimation of unstated noise and detection of outliers.

The thresholds are validated by `benchmarks.outliers`.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from basecal.cell import Cell
from basecal.estimation.noise.estimate import NoiseEstimate
from basecal.estimation.outliers.robust_solve import RobustSolution, judge_again, leave_out_suspects, solve_robustly
from basecal.estimation.settings import Settings
from basecal.estimation.solve import Solution, solve_at_mode, solve_from
from basecal.estimation.view.measurement import Noise

_JUDGING_PASSES = 3
# Largest plausible noise of an arm: up to 9 mm and 7 mrad are reported for faulty arms (belts, links, a loose base).
_MOST_ROBOT_NOISE = 1.2e-2  # [m, rad]
_MOST_JITTER_S = 2e-2  # largest plausible jitter of stamps on arrival: with more, stamps do not belong to the images


def with_noise(solution: Solution, settings: Settings, guess: Solution | None = None) -> Solution:
    """Solve again with the most likely unstated sigmas; return the solution unchanged if the solve fails.

    Args:
        solution: The solution.
        settings: Settings of the solver.
        guess: Solution with sigmas estimated from nearly the same views, to start from.
    """
    estimated = replace(settings, robot_noise="estimated")
    try:
        sigmas = None if guess is None else guess.noise
        solved = solve_at_mode(solution.problem, solution.state, estimated, solution.findings, sigmas)
    except np.linalg.LinAlgError:
        return solution
    return replace(solved, disputed=solution.disputed)


def has_plausible_noise(solution: Solution) -> bool:
    """Whether a solution converged with estimated noise of robots and stamps that is plausible for real devices."""
    sigmas, jitter = list(solution.noise.robots.values()), list(solution.noise.jitter_s.values())
    is_plausible = all(max(s[0], s[3]) < _MOST_ROBOT_NOISE for s in sigmas) and all(s < _MOST_JITTER_S for s in jitter)
    return solution.converged and is_plausible and bool(sigmas or jitter)


def solve_with_noise(
    cell: Cell, settings: Settings, plain: Solution, noisy: Solution, exact: RobustSolution | None = None
) -> RobustSolution:
    """Solve without gross outliers and with the most likely unstated sigmas.

    The noise is first estimated from all views; outliers increase it but still have the largest deviations. It is
    estimated again without them, and all views are classified again, until the outliers no longer change. If the noise
    from all views is implausible for arms, the inliers under exact robots are used instead.

    Args:
        cell: The cell.
        settings: Settings of the solver.
        plain: Solution of all views with zero noise for robots with unstated noise.
        noisy: Solution of all views with estimated noise.
        exact: Solution of the inliers under exact robots, if the noise from all views is implausible; else None.
    """
    stated = replace(settings, robot_noise="stated")
    solution, previous = noisy if exact is None else with_noise(exact.solution, settings), exact
    for judging_pass in range(_JUDGING_PASSES):
        with settings.stage("outliers"):
            robust = _judge(cell, stated, plain, solution, previous)
            if not judging_pass and not robust.outliers:
                robust = leave_out_suspects(robust, plain.problem, cell, stated) or robust
        if _outlier_views(robust) == _outlier_views(previous):
            break
        previous = robust
        solution = with_noise(robust.solution, settings, solution)
    held_problem = replace(solution.problem, held=True)
    # If plausible noise of arms does not explain the views, samples that agree under exact robots are more reliable.
    agreeing = robust.agreeing if has_plausible_noise(solution) or exact is None else robust.agreeing or exact.agreeing
    final = replace(solution, problem=held_problem, disputed=robust.solution.disputed)
    return replace(robust, solution=final, agreeing=agreeing)


def _judge(
    cell: Cell, settings: Settings, plain: Solution, solution: Solution, previous: RobustSolution | None
) -> RobustSolution:
    """Solve for the inliers under the sigmas of `solution`, starting from the previous inliers."""
    judged = None if previous is None else judge_again(previous, solution, plain.problem, cell, settings)
    if judged is not None:
        return judged
    held_problem = solution.noise.hold_sigmas(plain.problem)
    if previous is None:  # the noise was estimated from all views, and the optimum under it is known
        all_views = replace(solution, problem=held_problem, noise=NoiseEstimate(Noise(), 1.0, (), True))
    else:
        all_views = solve_from(held_problem, solution.state, settings, plain.findings)
    return solve_robustly(held_problem, cell, settings, replace(all_views, disputed=plain.disputed))


def _outlier_views(robust: RobustSolution | None) -> list[tuple[int, str, str]]:
    """Sample, camera and target of each view that has outliers."""
    return [] if robust is None else [(o.sample, o.camera, o.target) for o in robust.outliers]
