"""Compare calibrations of parts of the workspace with the calibration of the whole workspace, on held-out samples.

Errors of arms that are smooth in the pose are nearly constant in a part of the workspace. A local calibration may
compensate them, but averages noise over fewer samples. Each part is fitted from all samples, with small weights far
from its middle. Both fits predict held-out samples of the part. The noise of a few samples decides which fit predicts
better. A local fit is therefore recommended only if it also differs from the global fit by more than noise explains.
Source: "Base Calibration for Dual Robot System" (local calibration); Hausman 1978 (comparison of two estimates, one of
them efficient under noise alone); docs/mathematics.md (14.4), (14.5).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from scipy.special import chdtrc

from basecal.accuracy.covariance.widening import state_step
from basecal.accuracy.cross_validation.folds import splits
from basecal.accuracy.cross_validation.refit import Refit, refit_folds, with_known_stops
from basecal.accuracy.residuals.fit import single_view_pose
from basecal.accuracy.task.meeting import target_places
from basecal.cell import LocalFit
from basecal.estimation.least_squares.normal_equations import linearise
from basecal.estimation.solve import Solution
from basecal.geometry import SE3, Array, BoolArray, IntArray
from basecal.numerics.spectral import spectrum

FEWEST_SAMPLES = 10
"""Smallest number of samples of a part: with fewer, a local fit has hardly more equations than unknowns."""

MOST_PARTS = 4
"""Largest number of parts of a workspace; each part takes as long as a cross-validation."""

CHANCE_LIMIT = 0.01
"""p-value of the difference of the fits, below which a local fit is recommended."""

_EQUAL_SHARE = 1e-6  # share of a variance along a direction, below which both fits are equal there


def local_fits(solution: Solution, names: Sequence[str], box_m: Sequence[float] | None = None) -> tuple[LocalFit, ...]:
    """Fit each part of the workspace, and compare the held-out errors of the local and the global fit.

    Args:
        solution: The fit of all samples.
        names: Names of the transforms to report for the local fits.
        box_m: (6,) two opposite corners of the only part, in the reference's base [m]. If None, the workspace is split
            into parts.

    Returns:
        One comparison for each part; empty without names, or if the samples are too few for parts.
    """
    problem = solution.problem
    places = [target_places(group, solution.state) for group in problem.groups]
    samples = [group.sample for group in problem.groups]
    split = next(splits(problem), None)
    if not (places and names) or split is None:
        return ()
    positions, view_samples = np.concatenate(places), np.concatenate(samples)
    parts = list(_halves(positions, view_samples) if box_m is None else _samples_inside(positions, view_samples, box_m))
    if not parts:
        return ()
    folds = split.folds
    everywhere = refit_folds(problem, solution.state, folds)
    found = []
    for numbers in parts:
        inside = [np.isin(each, numbers) for each in samples]
        own = np.concatenate([at[mine] for at, mine in zip(places, inside, strict=True)])
        centre = own.mean(0)
        reach = max(float(np.sqrt(np.mean(np.sum((own - centre) ** 2, axis=1)))), np.finfo(np.float64).eps)
        view_weights = [np.exp(-0.5 * np.sum((at - centre) ** 2, axis=1) / reach**2) for at in places]
        local = refit_folds(problem, solution.state, [*folds, frozenset()], view_weights=view_weights)
        chance = _chance_of_noise(solution, local[-1], view_weights, names)
        found.append(_compare_fits(solution, everywhere, local, inside, centre, numbers, names, chance))
    return tuple(found)


def _halves(places: Array, samples: IntArray) -> Iterator[IntArray]:
    """Yield the sample numbers of parts of similar size, from bisections along the base's axis of largest extent."""
    parts = [np.arange(len(places))]
    while len(parts) < MOST_PARTS:
        widest = max(parts, key=len)
        along = places[widest][:, np.ptp(places[widest], axis=0).argmax()]
        low, high = widest[along <= np.median(along)], widest[along > np.median(along)]
        if min(len(np.unique(samples[low])), len(np.unique(samples[high]))) < FEWEST_SAMPLES:
            break
        parts = [part for part in parts if part is not widest] + [low, high]
    for part in parts if len(parts) > 1 else ():
        yield np.unique(samples[part])


def _samples_inside(places: Array, samples: IntArray, box_m: Sequence[float]) -> Iterator[IntArray]:
    """Yield the numbers of the samples in a box, if there are at least `FEWEST_SAMPLES`."""
    corners = np.reshape(box_m, (2, 3))
    inside = np.all((places >= corners.min(0)) & (places <= corners.max(0)), axis=1)
    numbers = np.unique(samples[inside])
    if len(numbers) >= FEWEST_SAMPLES:
        yield numbers


def _chance_of_noise(solution: Solution, fit: Refit, view_weights: Sequence[Array], names: Sequence[str]) -> float:
    """p-value of the difference between a local fit and the global fit, if there is only noise.

    A is the information of all views, A' that of views weighted by w, and M that weighted by w squared. The local fit
    has the covariance L = A'^-1 M A'^-1. The global fit has A^-1, which is also its covariance with the local fit.
    Their difference therefore has the covariance L - A^-1.
    """
    problem, state = solution.problem, solution.state
    unweighted, weighted, squared = (
        linearise(problem, state, weights).hessian
        for weights in (None, view_weights, [each**2 for each in view_weights])
    )
    inverse, global_covariance = spectrum(weighted).inverse, solution.noise.factor * spectrum(unweighted).inverse
    difference_covariance = solution.noise.factor * (inverse @ squared @ inverse) - global_covariance
    columns = problem.column_indices(names)
    step = state_step(problem, state, fit.optimum.state)[columns]
    if np.all(np.diag(difference_covariance)[columns] <= _EQUAL_SHARE * np.diag(global_covariance)[columns]):
        return 1.0  # all views have the same weight
    differs = spectrum(difference_covariance[np.ix_(columns, columns)], _EQUAL_SHARE)
    return float(chdtrc(int(differs.rank), float(step @ differs.inverse @ step)))


def _compare_fits(
    solution: Solution,
    everywhere: Sequence[Refit],
    fits: Sequence[Refit],
    masks: Sequence[BoolArray],
    centre: Array,
    numbers: IntArray,
    names: Sequence[str],
    chance: float,
) -> LocalFit:
    *held_out, whole = fits
    by_all = np.concatenate([_squares(solution, fit, masks) for fit in everywhere])
    by_part = np.concatenate([_squares(solution, fit, masks) for fit in held_out])
    is_comparable = all(fit.optimum.converged for fit in (*everywhere, *fits)) and len(by_all) > 1
    transforms = {name: whole.optimum.state.transforms[name] for name in names}
    rms = [float(np.sqrt(squares.mean())) if is_comparable else None for squares in (by_all, by_part)]
    is_better = is_comparable and chance < CHANCE_LIMIT and bool(by_part.mean() < by_all.mean())
    return LocalFit(
        centre, tuple(map(int, numbers)), rms[0], rms[1], chance if is_comparable else 1.0, is_better, transforms
    )


def _squares(solution: Solution, fit: Refit, masks: Sequence[BoolArray]) -> Array:
    """Squared distances of targets from their predictions, for the held-out views of a part, (n,) [m^2]."""
    state = with_known_stops(fit.optimum.state, fit.known)
    found = [np.zeros(0)]
    for group, mine in zip(solution.problem.groups, masks, strict=True):
        views = group.take(np.flatnonzero(mine & np.isin(group.sample, list(fit.held))))
        if not len(views):
            continue
        by_all: SE3 = solution.state.camera_from_target(views, solution.problem.stops)
        alone, enough = single_view_pose(solution.state, views, by_all)
        off = alone.inverse() @ state.camera_from_target(views, solution.problem.stops)
        found.append(np.sum(off.translation**2, axis=1)[enough])
    return np.concatenate(found)
