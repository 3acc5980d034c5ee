"""An answer by some of its views, if these measure the error of held-out samples as well as all."""

from __future__ import annotations

from dataclasses import replace

from basecal.estimation.noise.joint_estimate import MANY_VIEWS
from basecal.estimation.noise.robot_noise import some_views
from basecal.estimation.settings import Settings
from basecal.estimation.solve import Solution, solve_at_mode


def thin_solution(solution: Solution, settings: Settings) -> Solution:
    """The solution by at most 2,000 views of each camera and target, spread evenly, with the sigmas of all of them.

    As it is where there are no more, or where those have no optimum near that of all.
    """
    if max(map(len, solution.problem.groups), default=0) <= MANY_VIEWS:
        return solution
    problem, state = some_views(solution.problem, solution.state, MANY_VIEWS)
    found = solve_at_mode(replace(problem, held=True), state, settings)
    if not found.converged:
        return solution
    return replace(found, noise=solution.noise, covariance=solution.noise.factor * found.covariance)
