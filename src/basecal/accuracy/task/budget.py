"""The variance at the task by source, and what halving each source brings.

A covariance is homogeneous of degree one in the variances of its sources. It is therefore the sum of each variance
times the derivative to it, C W_s C. C is the covariance, and W_s a source's information about the unknowns and the
stops' errors. Source: Euler's theorem on homogeneous functions; docs/mathematics.md (14.1), (14.2).
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from basecal.accuracy.task.meeting import Meeting, make_meeting, worst_meeting
from basecal.accuracy.task.sources import Source, error_sources, stops_source
from basecal.accuracy.task.task import base_transforms
from basecal.cell import BudgetEntry, Calibration, Cell
from basecal.estimation.least_squares.normal_equations import linearise
from basecal.estimation.problem.problem import Problem, State
from basecal.estimation.solve import Solution
from basecal.geometry import Array
from basecal.numerics.spectral import spectrum

_LOG_STEP = 1e-2  # of a sigma to both sides: the bend makes 1e-4 of a share, rounding less
_LEAST_SHARE = 1e-4  # of the variance: what is left over below it is rounding
NOISE_SOURCE = "how well the noise is known"
SHARED_SOURCE = "shared errors of the arms' poses, and how well the noise is known"


def calibration_budget(
    cell: Cell, calibration: Calibration, solution: Solution, widenings: Mapping[str, Array], points_m: Array
) -> tuple[BudgetEntry, ...] | None:
    """The budget of the error where robots meet at the task.

    Args:
        cell: What was calibrated.
        calibration: What came out.
        solution: What it was made of.
        widenings: (p, p) by name what was added to the covariance of the problem.
        points_m: (n, 3) the task in the reference's base [m].

    Returns:
        The largest first; None if nothing of it is known.
    """
    known = [name for name in base_transforms(cell) if name in calibration.transforms]
    if not known or calibration.meeting is None:
        return None
    meetings = [make_meeting(cell, solution.problem, solution.state, name, points_m) for name in known]
    meeting = worst_meeting(meetings, solution.covariance)
    added = {name: float(np.trace(meeting.weight @ matrix)) for name, matrix in widenings.items()}
    rest = SHARED_SOURCE if solution.noise.common else NOISE_SOURCE
    return budget(solution, meeting, calibration.meeting.variance_m2, added, rest)


def budget(
    solution: Solution, meeting: Meeting, total_m2: float, additions: Mapping[str, float], rest: str = NOISE_SOURCE
) -> tuple[BudgetEntry, ...]:
    """The variance of a meeting by source, the largest first.

    Args:
        solution: The problem, its optimum and its covariance.
        meeting: Where, and of what.
        total_m2: The variance there in all [m^2].
        additions: By name what of it is beside the noise of the problem [m^2].
        rest: What else there is, in words: what the sigmas are integrated over.
    """
    problem, state, weight = solution.problem, solution.state, meeting.weight
    variances, halved = dict(additions), {name: 0.75 * variance for name, variance in additions.items()}
    own = {stops_source(robot): 3 * float(of_stop[0]) for robot, of_stop in meeting.stop_variances().items()}
    now, shares = _variance(solution, weight, problem, state), source_variances(solution, weight)
    for source in error_sources(problem):
        at_stop = own.get(source.name, 0.0)
        variances[source.name] = shares[source.name] + at_stop
        halved[source.name] = now - _variance(solution, weight, *source.scaled(problem, state, 0.5)) + 0.75 * at_stop
    left = total_m2 - sum(variances.values())
    if left > _LEAST_SHARE * total_m2:
        variances[rest], halved[rest] = left, 0.75 * left
    elif left < 0:
        # Integrated over what the sigmas may be, the answer is known a little better than at the likeliest: all shrink.
        scale = total_m2 / sum(variances.values())
        variances = {name: scale * variance for name, variance in variances.items()}
        halved = {name: scale * gain for name, gain in halved.items()}
    largest_first = sorted(
        (name for name, variance in variances.items() if variance > 0), key=lambda name: -variances[name]
    )
    return tuple(_entry(name, variances[name], total_m2, halved[name]) for name in largest_first)


def source_variances(solution: Solution, weight: Array) -> dict[str, float]:
    """The variance by source of what a weight (p, p) makes of the covariance, at the likeliest sigmas."""
    return {source.name: _share(solution, weight, source) for source in error_sources(solution.problem)}


def _entry(name: str, variance: float, total: float, gain: float) -> BudgetEntry:
    rms_m, left_m = (float(np.sqrt(max(square, 0.0))) for square in (variance, total - gain))
    return BudgetEntry(name, rms_m, variance / total if total > 0 else 0.0, left_m)


def _share(solution: Solution, weight: Array, source: Source) -> float:
    """The variance that comes of a source [m^2]: its derivative to the logarithm of the source's own."""
    more, less = (
        _variance(solution, weight, *source.scaled(solution.problem, solution.state, float(np.exp(step))))
        for step in (_LOG_STEP, -_LOG_STEP)
    )
    return (more - less) / (4 * _LOG_STEP)


def _variance(solution: Solution, weight: Array, problem: Problem, state: State) -> float:
    covariance = spectrum(linearise(problem, state).hessian).inverse * solution.noise.factor
    return float(np.trace(weight @ covariance))
