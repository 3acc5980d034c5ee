"""Prediction error of a hypothesis about the input for held-out samples.

`benchmarks.mutations` judges its limits.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from basecal.accuracy.cross_validation.folds import instant_split
from basecal.accuracy.cross_validation.refit import refit_folds
from basecal.accuracy.input_check.loop_fit import trimmed_rms
from basecal.accuracy.input_check.view_errors import PIXEL_SCALE, view_errors
from basecal.cell import Cell
from basecal.errors import BasecalError
from basecal.estimation.least_squares.bundle_adjustment import bundle_adjust
from basecal.estimation.noise.estimate import PLAUSIBLE_PX, PLAUSIBLE_SIGMAS, degrees_of_freedom
from basecal.estimation.noise.robot_noise import without_errors
from basecal.estimation.problem.problem import Problem, State
from basecal.estimation.settings import Settings
from basecal.estimation.solve import Solution, solve_from, solve_problem
from basecal.estimation.start.rotation_search import KEPT_SHARE
from basecal.estimation.view.pixels import PixelMeasurement
from basecal.fields.digits import two_digits
from basecal.geometry import Array, IntArray

FOLDS = 3  # few, since each needs a fit of every hypothesis
_HEAVY_TAIL = 2.0  # rms of all over rms of the best 70 %: 1.8 for one normal residual per view, smaller for more
_CONCENTRATIONS = 2
_MOST_STEPS = 25  # iterations of a hypothesis: true ones converge within ten; free link parameters may need many
_PLAUSIBLE_RAD = 0.03  # [rad] of angles, and lengths over the distance: more than the error of any pose detector
_LOST_RAD = 1e3  # [rad] error of a view whose error is not finite


@dataclass(frozen=True, eq=False)
class HypothesisFit:
    """Fit of a hypothesis with its prediction errors.

    Attributes:
        solution: The fit to the samples that agree with the hypothesis.
        off: Prediction error of each held-out view, (n,). It is in thousands of pixels, or combines the angle and the
            length over the distance to the target [rad].
        sample: Sample number of each view, (n,).
        in_pixels: Whether the views are pixels.
    """

    solution: Solution
    errors: Array
    sample: IntArray
    in_pixels: bool

    @property
    def trimmed_rms(self) -> float:
        """RMS of the smallest 70 % of the prediction errors."""
        return trimmed_rms(self.errors)

    @property
    def rms(self) -> float:
        """RMS of all prediction errors."""
        return trimmed_rms(self.errors, 1.0)

    def squares(self, samples: IntArray) -> Array:
        """Mean squared error of each of these samples, (k,)."""
        row = np.searchsorted(samples, self.sample)
        is_given = np.isin(self.sample, samples)
        squares = np.where(np.isfinite(self.errors), self.errors, _LOST_RAD)[is_given] ** 2
        ones = np.ones(len(squares))
        sums, counts = (np.bincount(row[is_given], weights, len(samples)) for weights in (squares, ones))
        mean: Array = sums / counts
        return mean

    def error_in_words(self) -> str:
        """The error with its unit, as text."""
        if not np.isfinite(self.trimmed_rms):
            return "not at all"
        if self.in_pixels:
            return f"{two_digits(self.trimmed_rms / PIXEL_SCALE)} px"
        return f"{two_digits(1e3 * self.trimmed_rms)} mm/m (mrad)"


def is_plausible(fit: HypothesisFit) -> bool:
    """Whether a fit is an optimum with residuals of at most a few sigmas or pixels."""
    return is_near(fit) and (bool(fit.solution.noise.estimated) or residual_ratio(fit.solution) < PLAUSIBLE_SIGMAS)


def is_near(fit: HypothesisFit) -> bool:
    """Whether a fit is an optimum with residuals of at most a few pixels or hundredths of a radian."""
    if not fit.solution.converged or not np.isfinite(fit.solution.cost):
        return False
    return fit.trimmed_rms < (PIXEL_SCALE * PLAUSIBLE_PX if fit.in_pixels else _PLAUSIBLE_RAD)


def residual_ratio(solution: Solution) -> float:
    """Ratio of the residuals to their expected size."""
    return float(np.sqrt(solution.cost / max(solution.dof, 1)))


def fit_hypothesis(
    cell: Cell, problem: Problem, settings: Settings, start: State | None = None, limit: float = np.inf
) -> HypothesisFit | None:
    """Fit a cell and compute its held-out errors over three folds; None if the fit fails.

    An implausible fit is not cross-validated: its errors are the residuals of the fit. If a few views have large
    errors, the fit is repeated on the others, so that gross outliers do not hide a hypothesis.

    Args:
        cell: The cell under the hypothesis.
        problem: The problem under the hypothesis.
        settings: Settings of the solver.
        start: Initial state; None to compute one.
        limit: Largest `trimmed_rms` of interest: None is returned if the fit from `start` exceeds it.
    """
    if not problem.groups:
        return None
    if np.isfinite(limit):
        settings = replace(settings, iterations=min(settings.iterations, _MOST_STEPS))
    try:
        if start is None:
            solution = solve_problem(problem, cell, settings)
        else:
            recorded = without_errors(problem, start)
            start = bundle_adjust(problem, recorded, degrees_of_freedom(problem), settings.iterations).state
            if trimmed_rms(np.concatenate([view_errors(problem, g, start) for g in problem.groups])) > limit:
                return None
            solution = solve_from(problem, start, settings)
        solution = _concentrate(solution, settings)
        in_pixels = any(isinstance(g.measurement, PixelMeasurement) for g in problem.groups)
        fit = HypothesisFit(solution, *_view_errors([(problem, solution.state)]), in_pixels)
        predicted = _held_out_errors(problem, solution) if is_near(fit) else None
        return fit if predicted is None else HypothesisFit(solution, *predicted, in_pixels)
    except (BasecalError, np.linalg.LinAlgError):
        return None


def _concentrate(solution: Solution, settings: Settings) -> Solution:
    """Refit to the views with the smallest errors if the others have far larger ones."""
    whole = solution.problem
    for _ in range(_CONCENTRATIONS):
        errors = [view_errors(whole, group, solution.state) for group in whole.groups]
        all_errors = np.concatenate(errors)
        if trimmed_rms(all_errors, 1.0) < _HEAVY_TAIL * trimmed_rms(all_errors):
            return solution
        limit = np.quantile(all_errors, KEPT_SHARE, method="lower")  # errors may be infinite
        groups = (group.take(np.flatnonzero(own <= limit)) for group, own in zip(whole.groups, errors, strict=True))
        kept = whole.with_groups(g for g in groups if len(g))
        if not kept.groups:
            return solution
        solution = solve_from(kept, solution.state, settings)
    return solution


def _held_out_errors(problem: Problem, solution: Solution) -> tuple[Array, IntArray] | None:
    """Held-out errors of all views, each from the fit without its fold, and their sample numbers.

    None if no samples can be held out.
    """
    split = instant_split(problem, FOLDS)
    if split is None:
        return None
    refits = refit_folds(solution.problem, solution.state, split.folds, prediction_problem=problem)
    return _view_errors([(fit.views, fit.optimum.state) for fit in refits])


def _view_errors(predictions: Sequence[tuple[Problem, State]]) -> tuple[Array, IntArray]:
    """Errors of the views of problems, each with its state, (n,), and their sample numbers, (n,)."""
    views = [(problem, group, state) for problem, state in predictions for group in problem.groups]
    return np.concatenate([view_errors(*each) for each in views]), np.concatenate(
        [group.sample for _, group, _ in views]
    )
