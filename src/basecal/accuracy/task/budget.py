"""Error budget at the task: the variance from each source of noise or prior, and the effect of halving its sigma.

A covariance is homogeneous of degree one in the variances of its sources. It is therefore the sum over sources of the
variance times the derivative of the covariance with respect to it. Each of these products is C W_s C. C is the
covariance, and W_s the information of a source about the unknowns and the stops' errors. Source: Euler's theorem on
homogeneous functions; docs/mathematics.md (14.1), (14.2).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from basecal.accuracy.task.meeting import Meeting, find_worst_meeting
from basecal.cell import BudgetEntry, Calibration, Cell
from basecal.estimation.least_squares.normal_equations import linearise
from basecal.estimation.problem.problem import Problem, State
from basecal.estimation.solve import Solution
from basecal.geometry import Array
from basecal.numerics.spectral import spectrum

_LOG_STEP = 1e-2  # of a sigma in both directions: the curvature causes an error of 1e-4 of a share, rounding less
_LEAST_SHARE = 1e-4  # of the variance: a smaller remainder is rounding
NOISE_SOURCE = "how well the noise is known"
SHARED_SOURCE = "shared errors of the arms' poses, and how well the noise is known"


def calibration_budget(
    cell: Cell, calibration: Calibration, solution: Solution, widenings: Mapping[str, Array], points_m: Array
) -> tuple[BudgetEntry, ...] | None:
    """Compute the error budget of two robots that meet at the task.

    Args:
        cell: The calibrated cell.
        calibration: Its calibration, with the expected error at the task.
        solution: The solution of the calibration.
        widenings: (p, p) covariances that were added to that of the solution, by name.
        points_m: (n, 3) points of the task in the reference's base [m].

    Returns:
        Entries of the budget, the largest first; None if the calibration has no error at the task.
    """
    meeting = find_worst_meeting(cell, calibration, solution, points_m)
    if meeting is None or calibration.meeting is None:
        return None
    added = {name: float(np.trace(meeting.weight @ matrix)) for name, matrix in widenings.items()}
    rest = SHARED_SOURCE if solution.noise.common else NOISE_SOURCE
    return budget(solution, meeting, calibration.meeting.variance_m2, added, rest)


def budget(
    solution: Solution, meeting: Meeting, total_m2: float, additions: Mapping[str, float], rest: str = NOISE_SOURCE
) -> tuple[BudgetEntry, ...]:
    """Compute the variance of a meeting from each source, the largest first.

    Args:
        solution: The problem, its optimum and its covariance.
        meeting: The robots that meet, and the points.
        total_m2: Total variance of the meeting [m^2].
        additions: Variances from other sources than the noise of the problem, by name [m^2].
        rest: Name of the source of the remaining variance, which is due to the integration over the sigmas.
    """
    problem, state, weight = solution.problem, solution.state, meeting.weight
    variances, halved = dict(additions), {name: 0.75 * variance for name, variance in additions.items()}
    stop_variances = {stops_source(robot): 3 * float(of_stop[0]) for robot, of_stop in meeting.stop_variances().items()}
    now_m2 = _variance(solution, weight, problem, state)
    for source in error_sources(problem):
        at_stop = stop_variances.get(source.name, 0.0)
        variances[source.name] = source_variance(solution, weight, source) + at_stop
        halved[source.name] = (
            now_m2 - _variance(solution, weight, *source.scale_sigma(problem, state, 0.5)) + 0.75 * at_stop
        )
    left = total_m2 - sum(variances.values())
    if left > _LEAST_SHARE * total_m2:
        variances[rest], halved[rest] = left, 0.75 * left
    elif left < 0:
        # Integrated over the sigmas, the variance is slightly smaller than at their likeliest values: scale all.
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


def source_variance(solution: Solution, weight: Array, source: Source) -> float:
    """Variance from a source [m^2]: derivative of the total with respect to the log variance of the source."""
    more, less = (
        _variance(solution, weight, *source.scale_sigma(solution.problem, solution.state, float(np.exp(step))))
        for step in (_LOG_STEP, -_LOG_STEP)
    )
    return (more - less) / (4 * _LOG_STEP)


def _variance(solution: Solution, weight: Array, problem: Problem, state: State) -> float:
    covariance = spectrum(linearise(problem, state).hessian).inverse * solution.noise.factor
    return float(np.trace(weight @ covariance))


@dataclass(frozen=True)
class Source:
    """A source of error.

    Attributes:
        name: Description of the source with the name of its camera, robot or transform.
        scale_sigma: Function of a problem, a state and a factor: the problem and the state with the source's sigma
            multiplied by the factor. Errors of stops stay the same in metres.
    """

    name: str
    scale_sigma: Callable[[Problem, State, float], tuple[Problem, State]]


def error_sources(problem: Problem) -> Iterator[Source]:
    """Yield all sources of a problem with stated or estimated sigmas: views, robots' stops, priors."""
    for camera in sorted({group.camera for group in problem.groups}):
        yield Source(f"views of {camera}", partial(_scale_views, camera))
    for robot in sorted(set(problem.stops.robot)):
        yield Source(stops_source(robot), partial(_scale_stops, robot))
    for name in problem.columns:
        if name in problem.unknowns and problem.unknowns[name].status == "prior":
            yield Source(f"prior of {name}", partial(_scale_prior, "unknowns", name))
        elif name in problem.lenses and problem.lenses[name].status == "prior":
            yield Source(f"lens of {name}", partial(_scale_prior, "lenses", name))
    for robot, model in problem.models.items():
        if any(sigma is not None for sigma in model.sigmas.values()):
            yield Source(f"kinematics of {robot}", partial(_scale_kinematics, robot))


def stops_source(robot: str) -> str:
    """Name of the source for the stop errors of a robot."""
    return f"repeatability of {robot}"


def _scale_views(camera: str, problem: Problem, state: State, factor: float) -> tuple[Problem, State]:
    groups = (
        replace(g, measurement=g.measurement.noisier(factor)) if g.camera == camera else g for g in problem.groups
    )
    return problem.with_groups(groups), state


def _scale_stops(robot: str, problem: Problem, state: State, factor: float) -> tuple[Problem, State]:
    factors = np.where(problem.stops.robot_mask([robot]), factor, 1.0)[:, None]
    stops = replace(problem.stops, sigma=problem.stops.sigma * factors)
    return replace(problem, stops=stops), replace(state, stop_errors=state.stop_errors / factors)


def _scale_prior(kind: str, name: str, problem: Problem, state: State, factor: float) -> tuple[Problem, State]:
    stated = getattr(problem, kind)
    wider: dict[str, Any] = {kind: {**stated, name: replace(stated[name], sigma=stated[name].sigma * factor)}}
    return replace(problem, **wider), state


def _scale_kinematics(robot: str, problem: Problem, state: State, factor: float) -> tuple[Problem, State]:
    model = problem.models[robot]
    columns = {
        kind: parameters if parameters.sigma is None else parameters._replace(sigma=parameters.sigma * factor)
        for kind, parameters in model.columns.items()
    }
    return replace(problem, models={**problem.models, robot: replace(model, columns=columns)}), state
