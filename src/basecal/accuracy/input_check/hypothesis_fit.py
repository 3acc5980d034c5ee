"""How well a hypothesis about the input predicts held-out samples.

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
from basecal.estimation.problem.problem import Problem, State
from basecal.estimation.settings import Settings
from basecal.estimation.solve import Solution, solve_from, solve_problem
from basecal.estimation.start.rotation_search import KEPT_SHARE
from basecal.estimation.view.pixels import PixelMeasurement
from basecal.geometry import Array, IntArray

FOLDS = 3  # few, since each costs a fit of every hypothesis
_HEAVY_TAIL = 2.0  # rms of all over rms of the best 70 %: 1.8 of one normal residual a view, less of more
_CONCENTRATIONS = 2
_MOST_STEPS = 25  # of a hypothesis: what is so comes to rest within ten, free links of robots chase what is not
_PLAUSIBLE_RAD = 0.03  # [rad] of angles, and lengths over the distance, beyond any detector of poses
_LOST = 1e3  # [rad] of a view whose error is no number


@dataclass(frozen=True, eq=False)
class HypothesisFit:
    """A hypothesis' fit and what it predicts.

    Attributes:
        solution: The fit to the samples that agree with it.
        off: (n,) error of each held-out view against its prediction. It is in thousands of pixels, or combines the
            angle and the length over the distance to the target [rad].
        sample: (n,) numbers of their samples.
        in_pixels: Whether views are of pixels.
    """

    solution: Solution
    off: Array
    sample: IntArray
    in_pixels: bool

    @property
    def core(self) -> float:
        """Rms of the 70 % of views that are predicted best."""
        return trimmed_rms(self.off)

    @property
    def rms(self) -> float:
        """Rms of all views."""
        return trimmed_rms(self.off, 1.0)

    def squares(self, samples: IntArray) -> Array:
        """Mean squared error of each of these samples, (k,)."""
        place = np.searchsorted(samples, self.sample)
        known = np.isin(self.sample, samples)
        off = np.where(np.isfinite(self.off), self.off, _LOST)[known] ** 2
        sums, counts = (np.bincount(place[known], weights, len(samples)) for weights in (off, np.ones(len(off))))
        mean: Array = sums / counts
        return mean

    def error_in_words(self) -> str:
        """The error with its unit, for people."""
        if not np.isfinite(self.core):
            return "not at all"
        if self.in_pixels:
            return f"{self.core / PIXEL_SCALE:.3g} px"
        return f"{1e3 * self.core:.3g} mm a metre (or mrad)"


def plausible(fit: HypothesisFit) -> bool:
    """Whether data could have come from there: an optimum with residuals of a few sigmas or pixels, not more."""
    return is_near(fit) and (bool(fit.solution.noise.estimated) or ratio(fit.solution) < PLAUSIBLE_SIGMAS)


def is_near(fit: HypothesisFit) -> bool:
    """Whether it is an optimum with residuals of a few pixels or hundredths of a radian."""
    if not fit.solution.converged or not np.isfinite(fit.solution.cost):
        return False
    return fit.core < (PIXEL_SCALE * PLAUSIBLE_PX if fit.in_pixels else _PLAUSIBLE_RAD)


def ratio(solution: Solution) -> float:
    """Residuals over what their sigmas explain."""
    return float(np.sqrt(solution.cost / max(solution.dof, 1)))


def fit_hypothesis(
    cell: Cell, problem: Problem, settings: Settings, start: State | None = None, limit: float = np.inf
) -> HypothesisFit | None:
    """The fit of a cell and its held-out errors over three folds; None where there is nothing to fit.

    A fit that no data could have come from is not held out: its errors are those that it was fitted to. Where a few
    views are far off, the fit is repeated on the others, so that gross outliers do not hide a hypothesis.

    Args:
        cell: As the hypothesis has it.
        problem: Likewise.
        settings: How to solve.
        start: Where to start; without a guess where None.
        limit: `core` from which on a fit is of no interest: None is returned.
    """
    if np.isfinite(limit):
        settings = replace(settings, iterations=min(settings.iterations, _MOST_STEPS))
    # A wrong hypothesis may send the descent anywhere: infinities there are no error of the user's.
    with np.errstate(all="ignore"):
        return _fit(cell, problem, settings, start, limit)


def _fit(cell: Cell, problem: Problem, settings: Settings, start: State | None, limit: float) -> HypothesisFit | None:
    if not problem.groups:
        return None
    try:
        if start is None:
            solution = solve_problem(problem, cell, settings)
        else:
            start = replace(start, stop_errors=np.zeros((len(problem.stops), 6)))
            start = bundle_adjust(problem, start, degrees_of_freedom(problem), settings.iterations).state
            if trimmed_rms(np.concatenate([view_errors(problem, g, start) for g in problem.groups])) > limit:
                return None
            solution = solve_from(problem, start, settings)
        solution = _concentrate(solution, settings)
        in_pixels = any(isinstance(g.measurement, PixelMeasurement) for g in problem.groups)
        fitted = HypothesisFit(solution, *_view_errors([(problem, solution.state)]), in_pixels)
        predicted = _held_out_errors(problem, solution) if is_near(fitted) else None
        return fitted if predicted is None else HypothesisFit(solution, *predicted, in_pixels)
    except (BasecalError, np.linalg.LinAlgError):
        return None


def _concentrate(solution: Solution, settings: Settings) -> Solution:
    """The solution of the views that agree best, where the others are far off."""
    whole = solution.problem
    for _ in range(_CONCENTRATIONS):
        off = [view_errors(whole, group, solution.state) for group in whole.groups]
        every = np.concatenate(off)
        if trimmed_rms(every, 1.0) < _HEAVY_TAIL * trimmed_rms(every):
            return solution
        limit = np.quantile(every, KEPT_SHARE)
        groups = (g.take(np.flatnonzero(o <= limit)) for g, o in zip(whole.groups, off, strict=True))
        kept = whole.with_groups(g for g in groups if len(g))
        if not kept.groups:
            return solution
        solution = solve_from(kept, solution.state, settings)
    return solution


def _held_out_errors(problem: Problem, solution: Solution) -> tuple[Array, IntArray] | None:
    """Held-out errors of all views, each by the fit to the folds that it is not in, and the numbers of their samples.

    None if no samples can be held out.
    """
    split = instant_split(problem, FOLDS)
    if split is None:
        return None
    refits = refit_folds(solution.problem, solution.state, split.folds, prediction_problem=problem)
    return _view_errors([(fit.views, fit.optimum.state) for fit in refits])


def _view_errors(predictions: Sequence[tuple[Problem, State]]) -> tuple[Array, IntArray]:
    """How far views of problems are off the states beside them, (n,), and the numbers of their samples, (n,)."""
    views = [(problem, group, state) for problem, state in predictions for group in problem.groups]
    return np.concatenate([view_errors(*each) for each in views]), np.concatenate(
        [group.sample for _, group, _ in views]
    )
