"""The variance at the task by source, and what halving each source brings.

A covariance is of the first degree in the variances of its sources, so that it is the sum, over them, of each variance
times the derivative to it: C W_s C, with C the covariance and W_s what a source says of the unknowns and the stops'
errors. Source: Euler's theorem on homogeneous functions; docs/mathematics.md (14.1), (14.2).
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from basecal.accuracy.task.sources import Source, error_sources
from basecal.accuracy.task.task import Task, base_transforms, least_known, make_task
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
    cell: Cell, calibration: Calibration, solution: Solution, widenings: Mapping[str, Array], point_m: Array
) -> tuple[BudgetEntry, ...] | None:
    """The budget of what a calibration places in the reference's base, at a task point there.

    Args:
        cell: What was calibrated.
        calibration: What came out.
        solution: What it was made of.
        widenings: (p, p) by name what was added to the covariance of the problem.
        point_m: (3,) in the reference's base [m].

    Returns:
        The largest first; None if nothing of it is known.
    """
    known = [name for name in base_transforms(cell) if name in calibration.transforms]
    if not known:
        return None
    transforms = {name: calibration[name].mean for name in known}
    covariances = {name: calibration[name].covariance for name in known}
    task = least_known([make_task(name, transforms, point_m[None]) for name in known], covariances)
    total = task.variance_m2(covariances[task.transform])
    added = {name: _task_variance(solution, task, matrix) for name, matrix in widenings.items()}
    rest = SHARED_SOURCE if solution.noise.common else NOISE_SOURCE
    return budget(solution, task, total, added, rest)


def budget(
    solution: Solution, task: Task, total_m2: float, added: Mapping[str, float], rest: str = NOISE_SOURCE
) -> tuple[BudgetEntry, ...]:
    """The variance at a task by source, the largest first.

    Args:
        solution: The problem, its optimum and its covariance.
        task: Where.
        total_m2: The variance there in all [m^2].
        added: By name what of it is beside the noise of the problem [m^2].
        rest: What else there is, in words: what the sigmas are integrated over.
    """
    variances, halved = dict(added), {name: 0.75 * variance for name, variance in added.items()}
    at = _variance(solution, task, solution.problem, solution.state)
    for source in error_sources(solution.problem):
        variances[source.name] = _share(solution, task, source)
        halved[source.name] = at - _variance(solution, task, *source.scaled(solution.problem, solution.state, 0.5))
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


def _entry(name: str, variance: float, total: float, gain: float) -> BudgetEntry:
    rms_m, left_m = (float(np.sqrt(max(square, 0.0))) for square in (variance, total - gain))
    return BudgetEntry(name, rms_m, variance / total if total > 0 else 0.0, left_m)


def _share(solution: Solution, task: Task, source: Source) -> float:
    """The variance that comes of a source [m^2]: its derivative to the logarithm of the source's own."""
    more, less = (
        _variance(solution, task, *source.scaled(solution.problem, solution.state, float(np.exp(step))))
        for step in (_LOG_STEP, -_LOG_STEP)
    )
    return (more - less) / (4 * _LOG_STEP)


def _variance(solution: Solution, task: Task, problem: Problem, state: State) -> float:
    return _task_variance(solution, task, spectrum(linearise(problem, state).hessian).inverse * solution.noise.factor)


def _task_variance(solution: Solution, task: Task, covariance: Array) -> float:
    """The variance at the task [m^2] of a covariance of all columns, (p, p)."""
    where = solution.problem.columns[task.transform]
    size = where.stop - where.start
    own = np.zeros((6, 6))
    own[:size, :size] = covariance[where, where]
    return task.variance_m2(own)
