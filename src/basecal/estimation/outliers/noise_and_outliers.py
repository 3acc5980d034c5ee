"""Noise that nobody stated and outliers, each judged by the other until they agree.

`benchmarks.outliers` judges its limits.
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
# Of arms with errors of their own (belts, links, a loose base) up to 9 mm and 7 mrad are on record.
_ARM = 1.2e-2  # [m, rad]
_STAMP_S = 2e-2  # of computers that stamp what arrives: with more, stamps are not of the images


def with_noise(solution: Solution, settings: Settings, guess: Solution | None = None) -> Solution:
    """A solution with the most likely unstated sigmas; unchanged if its views are not finite.

    Args:
        solution: The solution.
        settings: How to solve.
        guess: One with sigmas of nearly the same views, to start from.
    """
    estimated = replace(settings, robot_noise="estimated")
    try:
        sigmas = None if guess is None else guess.noise
        found = solve_at_mode(solution.problem, solution.state, estimated, solution.findings, sigmas)
    except np.linalg.LinAlgError:
        return solution
    return replace(found, disputed=solution.disputed)


def is_as_of_arms(solution: Solution) -> bool:
    """Whether the noise of robots, and of stamps, that was estimated is such as arms and computers in order have."""
    sigmas, jitter = list(solution.noise.robots.values()), list(solution.noise.jitter_s.values())
    as_usual = all(max(s[0], s[3]) < _ARM for s in sigmas) and all(s < _STAMP_S for s in jitter)
    return solution.converged and as_usual and bool(sigmas or jitter)


def solve_with_noise(
    cell: Cell, settings: Settings, plain: Solution, noisy: Solution, exact: RobustSolution | None = None
) -> RobustSolution:
    """The solution of all but the gross outliers, with the most likely unstated sigmas.

    Noise is estimated of all views first: outliers make it larger, yet stand out among the others. It is estimated
    again without those that stand out, and all views are judged by it, until none changes sides. If the first noise is
    more than arms have, what agrees as if robots were exact goes before it.

    Args:
        cell: What exists and what is known.
        settings: How to solve.
        plain: The solution of all views as if robots that state no noise had none.
        noisy: That with noise estimated of all views.
        exact: What agrees as if robots were exact; not used if the noise is such as arms have.
    """
    stated = replace(settings, robot_noise="stated")
    solution, before = noisy if exact is None else with_noise(exact.solution, settings), exact
    for judging_pass in range(_JUDGING_PASSES):
        with settings.stage("outliers"):
            robust = _judge(cell, stated, plain, solution, before)
            if not judging_pass and not robust.outliers:
                robust = leave_out_suspects(robust, plain.problem, cell, stated) or robust
        if _places(robust) == _places(before):
            break
        before = robust
        solution = with_noise(robust.solution, settings, solution)
    held = replace(solution.problem, held=True)
    # Where no arm's noise explains the views, those that alone close the loops of exact robots say more.
    agreeing = robust.agreeing if is_as_of_arms(solution) or exact is None else robust.agreeing or exact.agreeing
    found = replace(solution, problem=held, disputed=robust.solution.disputed)
    return replace(robust, solution=found, agreeing=agreeing)


def _judge(
    cell: Cell, settings: Settings, plain: Solution, solution: Solution, previous: RobustSolution | None
) -> RobustSolution:
    """Items that agree by the sigmas of `solution`, searched from those found before."""
    again = None if previous is None else judge_again(previous, solution, plain.problem, cell, settings)
    if again is not None:
        return again
    held = solution.noise.hold_sigmas(plain.problem)
    if previous is None:  # the noise is that of all views, whose optimum by it is known
        whole = replace(solution, problem=held, noise=NoiseEstimate(Noise(), 1.0, (), True))
    else:
        # From a state that outliers have pulled aside steps may overflow; such steps are not taken.
        with np.errstate(all="ignore"):
            whole = solve_from(held, solution.state, settings, plain.findings)
    return solve_robustly(held, cell, settings, replace(whole, disputed=plain.disputed))


def _places(robust: RobustSolution | None) -> list[tuple[int, str, str]]:
    """Sample, camera and target of each view that has outliers."""
    return [] if robust is None else [(o.sample, o.camera, o.target) for o in robust.outliers]
