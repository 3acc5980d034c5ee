"""Stated sigmas that the residuals contradict, and the answer without these statements.

If the sigmas are true, the sum of squares of n residuals, each over its sigma, has the mean n - gamma. gamma is the
number of unknowns, including stop errors, that these residuals determine. The sum scatters at most as a chi-square
variable with n - gamma degrees of freedom. Source: docs/mathematics.md (5.1).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtr

from basecal.accuracy.model_comparison.nested_models import (
    LEAST_CHANCE,
    SINGLE_LEVEL,
    compare_evidence,
    decide,
    log_chance,
)
from basecal.estimation.least_squares.studentized_residuals import LeaveOneOut, leave_one_out
from basecal.estimation.noise.hyperpriors import ROBOT_RAD
from basecal.estimation.outliers.noise_and_outliers import with_noise
from basecal.estimation.outliers.robust_solve import RobustSolution
from basecal.estimation.settings import Settings
from basecal.estimation.solve import Solution, integrate_solution, solve_from
from basecal.estimation.view.common_error import without_motion
from basecal.estimation.view.measurement import ViewInformation
from basecal.geometry import Array
from basecal.numerics.spectral import inverse_beside_identity

_FEWEST_FREEDOMS = 3.0  # degrees of freedom below which residuals do not determine their sigma


@dataclass(frozen=True)
class ContradictedSigma:
    """Stated sigmas that the residuals contradict.

    Attributes:
        about: Name of the camera or robot; "" for all sigmas together.
        of_robot: Whether the sigmas are those of a robot's poses.
        ratio: Estimated sigma over the stated one.
        chance: Probability of residuals at least as small, or as large, if the sigmas are true.
    """

    about: str
    of_robot: bool
    ratio: float
    chance: float

    @property
    def is_too_small(self) -> bool:
        """Whether the residuals are larger than stated."""
        return self.ratio > 1


def contradicted_sigmas(solution: Solution) -> tuple[ContradictedSigma, ...]:
    """Stated sigmas of cameras and robots that the residuals contradict; the worst first.

    All sigmas are tested together only if none is contradicted alone.
    """
    if not solution.converged or not np.isfinite(solution.cost):
        return ()
    problem = solution.noise.hold_sigmas(solution.problem)
    model = leave_one_out(problem, solution.state, [np.ones(len(g)) for g in problem.groups])
    sums: dict[tuple[str, bool], list[float]] = {}
    for name, of_robot, squares, freedoms in (*_view_squares(model), *_stop_squares(model)):
        total = sums.setdefault((name, of_robot), [0.0, 0.0])
        total[0] += squares
        total[1] += freedoms
    stated = {key: s for key, s in sums.items() if key[1] and key[0] not in problem.unstated}
    counts = [(g.camera, name) for g in problem.groups for name, count in g.measurement.counts().items() if count]
    unstated = {camera for camera, name in counts if name != "stated"}
    stated |= {key: s for key, s in sums.items() if not key[1] and key[0] not in unstated}
    found = [f for (name, of_robot), s in stated.items() if (f := judge_sigma(name, of_robot, *s)) is not None]
    if not found and len(stated) == len(sums) > 1:
        found = [f for f in [judge_sigma("", False, solution.cost, solution.dof)] if f is not None]
    return tuple(sorted(found, key=lambda f: -abs(np.log(f.ratio))))


def unlikely_sigmas(solution: Solution, settings: Settings) -> tuple[ContradictedSigma, ...]:
    """Stated sigmas of robots that are implausibly small, if the data are more likely with these sigmas estimated.

    If the noise of views is unstated, it absorbs the errors of such robots: no residual contradicts the sigmas.
    """
    problem = solution.problem
    below = {
        name: float(problem.stops.sigma[k, 3:].mean())
        for k, name in enumerate(problem.stops.robot)
        if name not in problem.unstated and is_implausibly_small(problem.stops.sigma[k])
    }
    if not below or not solution.converged or solution.noise.logs is None:
        return ()
    opened = replace(problem, unstated=problem.unstated | below.keys(), held=False)
    rival = with_noise(replace(solution, problem=opened), settings).noise
    compared = compare_evidence(solution.noise.plain_minus_2_log_evidence - rival.plain_minus_2_log_evidence)
    ratios = {name: float(rival.robots[name][3:].mean() / stated) for name, stated in below.items()}
    return tuple(
        ContradictedSigma(name, True, ratio, compared.chance) for name, ratio in ratios.items() if compared.is_taken
    )


def is_implausibly_small(sigma: Array) -> bool:
    """Whether sigmas of a robot's poses, (6,) [m, rad], are implausibly small: invented, or in a wrong unit."""
    return bool(np.mean(sigma[3:]) < ROBOT_RAD[0] / ROBOT_RAD[1] ** 2)


def judge_sigma(name: str, of_robot: bool, squares: float, freedoms: float) -> ContradictedSigma | None:
    """Contradicted sigmas of a camera or robot; None if the squares agree with their degrees of freedom."""
    if freedoms < _FEWEST_FREEDOMS:
        return None
    squares = max(squares, LEAST_CHANCE)
    below = float(np.log(max(chdtr(freedoms, squares), LEAST_CHANCE)))
    chance = log_chance(squares, freedoms) if squares > freedoms else below
    compared = decide(squares, chance, SINGLE_LEVEL)
    ratio = float(np.sqrt(squares / freedoms))
    return ContradictedSigma(name, of_robot, ratio, compared.chance) if compared.is_taken else None


def _view_squares(model: LeaveOneOut) -> Iterator[tuple[str, bool, float, float]]:
    """Sum of squares and its expected value, for each camera, and for each robot with stops of single views."""
    for k, group in enumerate(model.problem.groups):
        private = model.normal.views[k].private
        poses = model.state.camera_from_target(group, model.problem.stops)
        lens = group.camera in model.problem.columns
        view = group.measurement.linearise(poses, model.state.cameras.get(group.camera), lens)
        jitter = model.problem.jitter_motion(group)
        view = view if jitter is None else ViewInformation(*without_motion(*view, jitter))
        by_error = model.normal.views[k].private_error_jacobian
        transposed = by_error.mT
        own = inverse_beside_identity(transposed @ view.information @ by_error)
        back = own @ transposed @ view.information
        carried = np.eye(view.gradient.shape[-1]) - by_error @ back
        posterior = carried @ model.spread[k] @ carried.mT + by_error @ own @ transposed
        determined = float(np.einsum("nij,nji->", posterior, view.information))
        count = sum(group.measurement.counts().values())
        yield group.camera, False, float(view.cost.sum()), count - determined
        errors = own + back @ model.spread[k] @ back.mT
        for i, part in enumerate(private):
            if len(part.view):
                known = np.diagonal(errors, axis1=-2, axis2=-1)[part.view, 6 * i : 6 * i + 6]
                squares = float(np.sum(model.state.stop_errors[part.stop] ** 2))
                yield model.problem.stops.robot[part.stop[0]], True, squares, float(np.sum(1 - known))


def _stop_squares(model: LeaveOneOut) -> Iterator[tuple[str, bool, float, float]]:
    """Sum of squares and its expected value, for the robot of each stop that several views share."""
    shared = np.flatnonzero(model.problem.shared_stops >= 0)
    expected = 6 - np.trace(model.shared_stop_covariance(), axis1=-2, axis2=-1)
    squares = np.sum(model.state.stop_errors[shared] ** 2, -1)
    for stop, square, freedoms in zip(shared, squares, expected, strict=True):
        yield model.problem.stops.robot[stop], True, float(square), float(freedoms)


def without_contradicted_sigmas(
    robust: RobustSolution, contradictions: Sequence[ContradictedSigma], settings: Settings
) -> RobustSolution:
    """Solution with estimated instead of stated sigmas, for sigmas that are larger than stated.

    If there are none, the sigmas that are smaller than stated are estimated, if this makes more transforms observable.
    Otherwise the solution is returned unchanged.

    Args:
        robust: Solution with the sigmas as stated.
        contradictions: The sigmas that the residuals contradict.
        settings: Settings of the solver; with stated robot noise, only the noise of views is estimated.
    """
    small = [f for f in contradictions if f.is_too_small]
    if small or not contradictions:
        return _estimate_sigmas(robust, small, settings) if small else robust
    hidden = robust.solution.observability.unobservable
    if not hidden:
        return robust
    estimated = _estimate_sigmas(robust, contradictions, settings)
    return estimated if estimated.solution.observability.unobservable < hidden else robust


def _estimate_sigmas(
    robust: RobustSolution, contradictions: Sequence[ContradictedSigma], settings: Settings
) -> RobustSolution:
    """Solution with these sigmas estimated."""
    solution = robust.solution
    everything = any(not f.about for f in contradictions)
    cameras = {f.about for f in contradictions if not f.of_robot}
    contradicted = {f.about for f in contradictions if f.of_robot}
    robots = {name for name in solution.problem.stops.robot if everything or name in contradicted}
    groups = (
        replace(g, measurement=g.measurement.without_sigmas()) if everything or g.camera in cameras else g
        for g in solution.problem.groups
    )
    problem = replace(solution.problem.with_groups(groups), held=False)
    if settings.robot_noise == "stated":
        estimated = solve_from(problem, solution.state, settings, solution.findings)
    else:
        opened = replace(problem, unstated=problem.unstated | robots)
        estimated = integrate_solution(with_noise(replace(solution, problem=opened), settings))
    # The views left out have stops of other numbers, whose errors the other views do not determine.
    left_out = robust.left_out.with_groups(group.without_stops() for group in robust.left_out.groups)
    return replace(robust, solution=replace(estimated, disputed=solution.disputed), left_out=left_out)
