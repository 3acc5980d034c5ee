"""Prediction of held-out samples, and consistency of the folds' solutions with the covariance of the full solution.

Each fold is fitted without its held-out samples, starting at the full solution and with the noise of the full solution.
For nested data, the covariance of the difference of two estimates is the difference of their covariances:
Cov(fold - full) = C_fold - C_full. Between folds it is Cov(j - full, k - full) = C_j (H_j + H_k - H) C_k - C_full, with
H the information of all samples.
Source: Hausman 1978; docs/mathematics.md (5.4).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy  # submodules are loaded on first use

from basecal.accuracy.covariance.widening import state_step
from basecal.accuracy.cross_validation.closed_form_rival import ClosedFormRival, closed_form_rival, opencv_rivals
from basecal.accuracy.cross_validation.folds import Samples, splits
from basecal.accuracy.cross_validation.refit import Refit, refit_folds, with_known_stops
from basecal.accuracy.model_comparison.nested_models import Comparison, compare_nested_models
from basecal.accuracy.residuals.fit import single_view_pose
from basecal.cell import Validation
from basecal.estimation.least_squares.jacobians import stop_error_jacobians
from basecal.estimation.least_squares.normal_equations import linearise
from basecal.estimation.least_squares.sparse_normal_equations import is_sparse, sparse_bundle
from basecal.estimation.observability.observability import analyse_observability, condition_number
from basecal.estimation.problem.problem import Problem, State, Stops, chain
from basecal.estimation.problem.view_group import ViewGroup
from basecal.estimation.settings import DEFAULT, Settings
from basecal.estimation.solve import Solution
from basecal.estimation.view.measurement import Measurement
from basecal.estimation.view.pixels import PixelMeasurement
from basecal.geometry import SE3, Array, BoolArray, IntArray
from basecal.numerics.spectral import scaled_spectrum, spectrum

# Limits of a fold's variance over that of the full solution, less one. Along a direction with less, the fold has lost
# no information beyond rounding; with more, it is too far from the full solution for a first-order comparison.
_LEAST_GAIN, _MOST_GAIN = 0.01, 10.0
_FEWEST_FREEDOMS = 5.0  # of the spread: with fewer, the relative sigma of its square exceeds two thirds


@dataclass(frozen=True, eq=False)
class _Fold:
    """A fit without some samples, and the requested columns (p, c) of the inverse of its information."""

    fit: Refit
    columns: Array

    @property
    def state(self) -> State:
        """State of the fit."""
        return self.fit.optimum.state

    @property
    def hessian(self) -> Array | scipy.sparse.csc_array:
        """(p, p) information of the used samples."""
        return self.fit.optimum.hessian if self.fit.sparse is None else self.fit.sparse.matrix


@dataclass(frozen=True)
class HeldOutErrors:
    """Sums of squared errors of held-out views.

    Attributes:
        cost: Sum of squared residuals over their sigmas.
        square_px: Sum of squared pixel residuals [px^2].
        count_px: Number of pixel coordinates.
        square_m: Sum of squared translation errors of the target [m^2].
        square_rad: Sum of squared rotation errors of the target [rad^2].
        count_poses: Number of target poses.
        uncertain: Part of `cost` that is expected from the uncertainty of unknowns and stops without these views.
    """

    cost: float = 0.0
    square_px: float = 0.0
    count_px: int = 0
    square_m: float = 0.0
    square_rad: float = 0.0
    count_poses: int = 0
    uncertain: float = 0.0

    def __add__(self, other: HeldOutErrors) -> HeldOutErrors:
        return HeldOutErrors(*(a + b for a, b in zip(vars(self).values(), vars(other).values(), strict=True)))


@dataclass(frozen=True)
class FoldSpread:
    """Spread of the folds' solutions about the full solution.

    Attributes:
        mean_square: Mean squared deviation over its expected variance.
        freedoms: Effective degrees of freedom of `mean_square`.
        beyond_covariance: Test of a spread wider than the covariance predicts.
    """

    mean_square: float
    freedoms: float
    beyond_covariance: Comparison


@dataclass(frozen=True, eq=False)
class CrossValidation:
    """Results of a cross-validation.

    Attributes:
        summary: Summary for the calibration; None if no fold could be fitted.
        spread: Spread of the folds' solutions about the full solution; None if they cannot be compared.
        fitted: Errors of the held-out views by the full solution.
        predicted: Errors of the same views by the folds that did not use them.
        skipped: Numbers of the samples without which a fold has no optimum or a requested transform is unobservable.
        rival: A closed form that predicts the held-out views better; None if there is none.
    """

    summary: Validation | None
    spread: FoldSpread | None
    fitted: HeldOutErrors
    predicted: HeldOutErrors
    skipped: Samples
    rival: ClosedFormRival | None = None


def cross_validate(
    solution: Solution, transform_names: Sequence[str], settings: Settings = DEFAULT
) -> CrossValidation | None:
    """Cross-validate a solution with up to five folds that keep stations together.

    A stop that no used sample shares is predicted at its recorded pose, as in later use of the calibration.

    Args:
        solution: The full solution.
        transform_names: Names of the requested transforms.
        settings: Settings with the number of iterations, and whether to compare with OpenCV.

    Returns:
        The cross-validation; None if the solution has not converged or a requested transform is unobservable.
    """
    free = [name for name in transform_names if name in solution.problem.columns]
    if not solution.converged or solution.observability.unobservable.intersection(free):
        return None
    chosen = solution.problem.column_indices(free)
    folds: list[_Fold] = []
    skipped: Samples = frozenset()
    for split in splits(solution.problem):
        refits = refit_folds(solution.problem, solution.state, split.folds, settings.iterations)
        tried = [_fold(solution, free, chosen, fit) for fit in refits]
        folds = [fold for fold in tried if fold is not None]
        skipped = frozenset().union(*(fit.held for fit, fold in zip(refits, tried, strict=True) if fold is None))
        if 2 * len(folds) > len(refits):
            break
    if not folds:
        return CrossValidation(None, None, HeldOutErrors(), HeldOutErrors(), skipped)
    fitted_errors, predicted_errors = _errors(solution, folds)
    kept_refits = [fold.fit for fold in folds]
    spread = _spread(solution, folds, chosen)
    summary = Validation(
        kind="k-fold" if any(len(fold.fit.held) > 1 for fold in folds) else "leave-one-out",
        folds=len(folds),
        rms_px=root_mean_square(predicted_errors.square_px, predicted_errors.count_px),
        target_m=root_mean_square(predicted_errors.square_m, predicted_errors.count_poses),
        target_rad=root_mean_square(predicted_errors.square_rad, predicted_errors.count_poses),
        base_change=None if spread is None else spread.mean_square,
        rivals=opencv_rivals(solution, kept_refits) if settings.against == "opencv" else (),
    )
    rival = closed_form_rival(solution, kept_refits)
    return CrossValidation(summary, spread, fitted_errors, predicted_errors, skipped, rival)


def _fold(solution: Solution, transform_names: Sequence[str], column_indices: IntArray, fit: Refit) -> _Fold | None:
    """Return a fold with columns of its covariance; None without an optimum or if a transform is unobservable."""
    end, factor = fit.optimum, solution.noise.factor
    if not end.converged:
        return None
    if fit.sparse is not None and condition_number(fit.used, end.state, fit.sparse, factor) is not None:
        return _Fold(fit, fit.sparse.inverse_columns(column_indices))
    observability = analyse_observability(fit.used, end.state, end.hessian, factor)
    if observability.unobservable.intersection(transform_names):
        return None
    return _Fold(fit, observability.inverse[:, column_indices])


def _errors(solution: Solution, folds: Sequence[_Fold]) -> tuple[HeldOutErrors, HeldOutErrors]:
    """Errors of the held-out views by the full solution, and by the folds that predict them."""
    problem, state = solution.problem, solution.state
    alone: dict[_GroupKey, _SingleViewPoses] = {}
    for group in problem.groups:
        if group.camera not in problem.columns:  # whose lens is known
            poses = single_view_pose(state, group, state.camera_from_target(group, problem.stops))
            alone[_group_key(group)] = _SingleViewPoses(group.sample, *poses)
    fitted, predicted = HeldOutErrors(), HeldOutErrors()
    for fold in folds:
        full, views = with_known_stops(state, fold.fit.known), fold.fit.views
        for group in views.groups:
            in_pixels = isinstance(group.measurement, PixelMeasurement)
            fitted += _group_errors(views, group, full, None if in_pixels else alone)
            predicted += _group_errors(views, group, fold.state, alone)
        predicted += HeldOutErrors(uncertain=_expected_cost(fold, solution.noise.factor))
    return fitted, predicted


def _expected_cost(fold: _Fold, factor: float) -> float:
    """Expected cost of held-out views from the uncertainty of the fold; 0 for sparse problems of many unknowns."""
    views, known = fold.fit.views, fold.fit.known
    if fold.fit.sparse is not None:
        return 0.0
    covariance = factor * spectrum(fold.fit.optimum.hessian).inverse
    bare = replace(views, groups=tuple(g.without_stops() for g in views.groups), stops=Stops(np.zeros((0, 6))))
    exact = linearise(bare, replace(fold.state, stop_errors=fold.state.stop_errors[:0]))
    total = 0.0
    for seen, group in zip(exact.views, views.groups, strict=True):
        spread = seen.by_unknowns @ covariance[np.ix_(seen.columns, seen.columns)] @ seen.by_unknowns.mT
        total += float(np.sum(seen.information * spread))
        parts = stop_error_jacobians(group, chain(group, fold.state, views.stops), fold.state, views.stops, rows=6)
        for stop, by_error in parts:
            by_open = by_error[~known[stop]]
            total += float(np.sum(by_open * (seen.information[~known[stop], :6, :6] @ by_open)))
    return total


_GroupKey = tuple[str, str, type[Measurement]]


def _group_key(group: ViewGroup) -> _GroupKey:
    """Key of a group: a camera may observe a target by several kinds of measurement."""
    return group.camera, group.target, type(group.measurement)


@dataclass(frozen=True, eq=False)
class _SingleViewPoses:
    """Poses of all views of a group by `single_view_pose`, with sample numbers; equal for all folds of a fixed lens."""

    sample: IntArray
    camera_from_target: SE3
    enough: BoolArray


def _group_errors(
    views: Problem, group: ViewGroup, state: State, single_views: Mapping[_GroupKey, _SingleViewPoses] | None
) -> HeldOutErrors:
    """Errors of a group's views; without errors of target poses if `single_views` is None."""
    predicted = state.camera_from_target(group, views.stops)
    cost = float(group.measurement.linearise(predicted, state.cameras.get(group.camera), False).cost.sum())
    square_px, count_px = 0.0, 0
    if isinstance(group.measurement, PixelMeasurement):
        off_px = group.measurement.residual_px(predicted, state.cameras[group.camera])[group.measurement.weight > 0]
        square_px, count_px = float(np.sum(off_px**2)), off_px.size
    if single_views is None:
        return HeldOutErrors(cost, square_px, count_px)
    known = single_views.get(_group_key(group))
    if known is None:
        pose, enough = single_view_pose(state, group, predicted)
    else:
        rows = np.flatnonzero(np.isin(known.sample, group.sample))
        pose, enough = known.camera_from_target[rows], known.enough[rows]
    off = (pose.inverse() @ predicted)[np.flatnonzero(enough)]
    square_m, square_rad = float(np.sum(off.translation**2)), float(np.sum(off.rotvec**2))
    return HeldOutErrors(cost, square_px, count_px, square_m, square_rad, int(enough.sum()))


def _spread(solution: Solution, folds: Sequence[_Fold], column_indices: IntArray) -> FoldSpread | None:
    """Spread of the requested transforms between the folds and the full solution, relative to its expected variance."""
    if not len(column_indices):
        return None
    hessian, factor = _information(solution), solution.noise.factor
    covariance = solution.covariance[np.ix_(column_indices, column_indices)]
    # Whiten a fold's change by its expected covariance, along the directions in which the fold has lost information.
    units = [_whitening(factor * fold.columns[column_indices], covariance) for fold in folds]
    moved = [state_step(solution.problem, solution.state, fold.state)[column_indices] for fold in folds]
    whitened = [unit @ change for unit, change in zip(units, moved, strict=True)]
    freedoms = sum(len(each) for each in whitened)
    if not freedoms:
        return None
    mean = sum(float(each @ each) for each in whitened) / freedoms

    def squares(i: int, j: int) -> float:
        """Sum of squared correlations between the whitened changes of two folds."""
        together = factor * _shared_covariance(folds[i], folds[j], hessian) - covariance
        return float(np.sum((units[i] @ together @ units[j].T) ** 2))

    correlation = sum((1 if i == j else 2) * squares(i, j) for i in range(len(folds)) for j in range(i + 1))
    effective = freedoms**2 / max(correlation, 1e-300)
    if effective < _FEWEST_FREEDOMS:
        return None
    is_estimated = bool(solution.noise.estimated) or solution.noise.factor != 1.0
    noise_freedoms = max(solution.dof, 1) if is_estimated else np.inf
    return FoldSpread(
        mean, effective, compare_nested_models(effective * mean, effective, noise_freedoms=noise_freedoms)
    )


def _information(solution: Solution) -> Array | scipy.sparse.csc_array:
    """(p, p) information of all samples, sparse if unknowns are many."""
    problem, state = solution.problem, solution.state
    if is_sparse(problem):
        return sparse_bundle(problem).linearise(state).hessian.matrix
    return linearise(problem, state).hessian


def _shared_covariance(first: _Fold, second: _Fold, hessian: Array | scipy.sparse.csc_array) -> Array:
    """Covariance between two folds' solutions at unit noise, from the information of the samples that both used."""
    both = first.hessian if first is second else first.hessian + second.hessian - hessian
    shared: Array = first.columns.T @ (both @ second.columns)
    return shared


def _whitening(fold: Array, full: Array) -> Array:
    """(m, n) matrix that whitens a fold's change along the directions that can be compared.

    Directions about which the held-out samples have no information are left out. Directions that only they determine
    are left out, too: there a fold is too far from the full solution for a first-order comparison.
    """
    unit = spectrum(full).inverse_root.T
    gain = scaled_spectrum(unit @ (fold - full) @ unit.T, _LEAST_GAIN)
    seen = gain.is_informative & (gain.values < _MOST_GAIN)
    return gain.inverse_root[:, seen].T @ unit


def root_mean_square(squares: float, count: int) -> float | None:
    """Root mean square from a sum of squares and a count; None if the count is 0 or the sum is not finite."""
    return float(np.sqrt(squares / count)) if count and np.isfinite(squares) else None
