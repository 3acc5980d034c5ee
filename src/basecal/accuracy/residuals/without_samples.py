"""Fast estimate of a calibration without some samples, starting at the calibration and with its noise."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace

import numpy as np

from basecal.accuracy.residuals.evaluation import apply_robot_noise, known_views, with_camera_noise
from basecal.accuracy.residuals.fit import residuals
from basecal.cell import Calibration, Cell, Recording, Residuals
from basecal.errors import InputError
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.problem import State
from basecal.estimation.settings import STATED
from basecal.estimation.solve import Solution, solve_from
from basecal.geometry import PoseEstimate


@dataclass(frozen=True, eq=False)
class WithoutSamples:
    """A calibration without some samples.

    Attributes:
        transforms: The requested transforms that are observable, by name.
        residuals: Residuals of the remaining samples.
        converged: Whether the solution has converged.
    """

    transforms: Mapping[str, PoseEstimate]
    residuals: Residuals
    converged: bool


def without_samples(
    cell: Cell, recording: Recording, calibration: Calibration, exclusions: Collection[int]
) -> WithoutSamples:
    """Estimate the calibration without some samples.

    The cell is solved with and without the samples, with the estimated noise. The change of each transform and of its
    covariance is applied to the calibration.

    Args:
        cell: The calibrated cell.
        recording: The recording of the calibration.
        calibration: The calibration.
        exclusions: Numbers of the samples to leave out.

    Raises:
        InputError: if no remaining sample has transforms that the calibration contains, or the calibration is from a
            scene alone.
    """
    if not exclusions:
        known = {name: calibration[name] for name in cell.requested_transforms if name in calibration.transforms}
        return WithoutSamples(known, calibration.residuals, True)
    kept = Recording(tuple(s for s in recording.samples if s.sample not in exclusions))
    solution, complete = (_solve_again(cell, each, calibration) for each in (kept, recording))
    transforms = {n: solution.transforms[n] for n in cell.requested_transforms if n in _observable_names(solution)}
    for name in transforms.keys() & calibration.transforms.keys() & _observable_names(complete):
        with_all, answer = complete.transforms[name], calibration[name]
        mean = answer.mean @ with_all.mean.inverse() @ transforms[name].mean
        transforms[name] = replace(
            answer, mean=mean, covariance=answer.covariance + transforms[name].covariance - with_all.covariance
        )
    return WithoutSamples(transforms, residuals(solution), solution.converged)


def _observable_names(solution: Solution) -> set[str]:
    return solution.transforms.keys() - solution.observability.unobservable


def _solve_again(cell: Cell, recording: Recording, calibration: Calibration) -> Solution:
    """Solve for the optimum near a calibration, with the estimated noise of the calibration."""
    known = known_views(cell, recording, calibration)
    if not known.problem.groups:
        if calibration.settings.get("method") == "scene":
            raise InputError("a calibration from a scene cannot be updated: calibrate again without these samples")
        raise InputError("no sample is left: exclude fewer samples, or choose a run with estimated transforms")
    problem, _ = build_problem(cell, recording)
    views = {(group.camera, group.target) for group in known.problem.groups}
    groups = [with_camera_noise(g, calibration) for g in problem.groups if (g.camera, g.target) in views]
    transforms = {name: unknown.mean for name, unknown in problem.unknowns.items() if unknown.mean is not None}
    start = State({**transforms, **known.state.transforms}, known.state.cameras, np.zeros((0, 6)), known.state.robots)
    found = apply_robot_noise(problem.with_groups(groups), start, calibration)
    return solve_from(replace(found.problem, held=True), found.state, STATED)
