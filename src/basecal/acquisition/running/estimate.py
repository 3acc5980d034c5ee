"""The estimate of a cell from the samples so far, with the covariance that the report would state."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from basecal.accuracy.covariance.widening import widen
from basecal.accuracy.noise_summary import noise_summary
from basecal.accuracy.robot_parameters import robot_parameters
from basecal.accuracy.systematic_errors.expected_sizes import with_expected_sizes
from basecal.accuracy.systematic_errors.search import running_error
from basecal.cell import Calibration, Cell, Recording, Sample
from basecal.effects.faces.effect import FoundEffect
from basecal.effects.registry import CONTAINED
from basecal.errors import BasecalError
from basecal.estimation.noise.estimate import NoiseEstimate
from basecal.estimation.noise.robot_noise import without_errors
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.problem import Problem
from basecal.estimation.settings import STATED, Settings
from basecal.estimation.solve import Solution, integrate_solution, solve_at_mode, solve_problem

MIN_SAMPLES = 4
"""Smallest number of samples for an estimate."""

_UNOBSERVABLE_SIGMA = 0.3  # [m, rad] of a transform, above which it counts as unobservable
_ESTIMATED = Settings(robot_noise="estimated")


@dataclass(frozen=True, eq=False)
class RunningEstimate:
    """Estimate of a cell from the samples so far.

    Attributes:
        solution: Transforms and noise.
        calibration: The solution as a calibration, for predictions of new samples.
        error: The likeliest systematic error of all samples; None if there is none.
        sigma: 3-D norms of the requested transform's sigmas [m] and [rad], as in the report; None if unobservable.
    """

    solution: Solution
    calibration: Calibration
    error: FoundEffect | None
    sigma: tuple[float, float] | None


def running_estimate(
    cell: Cell, samples: Sequence[Sample], previous: RunningEstimate | None = None
) -> RunningEstimate | None:
    """Estimate a cell from its samples.

    Args:
        cell: The cell.
        samples: The samples so far.
        previous: Estimate from nearly the same samples, for a warm start.

    Returns:
        None if the samples are too few, or the solve fails.
    """
    if sum(bool(sample.observations) for sample in samples) < MIN_SAMPLES:
        return None
    recording = Recording(tuple(samples))
    try:
        problem, _ = build_problem(cell, recording)
        at_mode, guess = _noise_mode(cell, problem, previous)
        solution = integrate_solution(at_mode, is_quick=True, guess=guess)
        stamps = {sample.sample: sample.stamp_s for sample in samples if sample.stamp_s is not None}
        error = running_error(solution, stamps)
    except (BasecalError, np.linalg.LinAlgError):
        return None
    if not solution.converged:
        return None
    return RunningEstimate(solution, _calibration(cell, recording, solution), error, _sigma(cell, solution, error))


def _noise_mode(
    cell: Cell, problem: Problem, previous: RunningEstimate | None
) -> tuple[Solution, NoiseEstimate | None]:
    """Solution at the most likely noise, and the previous noise estimate if the warm start succeeded."""
    if previous is not None and _structure(previous.solution.problem) == _structure(problem):
        start, noise = without_errors(problem, previous.solution.state), previous.solution.noise
        warm = solve_at_mode(problem, start, _ESTIMATED, guess=noise)
        if warm.converged:
            return warm, noise
    exact = solve_problem(problem, cell, STATED)
    return solve_at_mode(exact.problem, exact.state, _ESTIMATED), None


def _structure(problem: Problem) -> tuple[object, ...]:
    views = sorted((group.camera, group.target) for group in problem.groups)
    return views, problem.columns, sorted(problem.unstated)


def _calibration(cell: Cell, recording: Recording, solution: Solution) -> Calibration:
    known = [name for name in solution.transforms if name not in solution.observability.unobservable]
    order = tuple(name for name in known if solution.problem.unknowns[name].status != "fixed")
    return Calibration(
        "doubtful",
        {name: solution.transforms[name] for name in known},
        cameras={name: (lens, solution.lens_covariance(name)) for name, lens in solution.state.cameras.items()},
        robot_parameters=robot_parameters(solution),
        noise=noise_summary(cell, recording, solution),
        order=order,
        joint_covariance=solution.joint_transform_covariance(list(order)) if order else None,
    )


def _sigma(cell: Cell, solution: Solution, error: FoundEffect | None) -> tuple[float, float] | None:
    name = next(iter(cell.requested_transforms), "")
    if name not in solution.problem.columns or name in solution.observability.unobservable:
        return None
    solution = with_expected_sizes(cell, solution, error)
    if error is not None and error.effect not in CONTAINED:
        solution = widen(solution, error.moved)
    sigmas = solution.transforms[name].sigma_norms
    return sigmas if max(sigmas) < _UNOBSERVABLE_SIGMA else None
