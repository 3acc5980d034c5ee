"""Whether a calibration of a part of the workspace alone predicts held-out samples there better than that of all.

Errors of arms that are smooth in their poses are nearly the same in a part of the workspace, where a calibration may
take them up; noise it can only spread over fewer samples. Each part is fitted from all samples, those far from its
middle counting little, and both fits predict samples of it that neither has used.
Source: "Base Calibration for Dual Robot System" (local calibration); docs/mathematics.md (14.4).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from scipy.stats import t as student_t

from basecal.accuracy.cross_validation.folds import splits
from basecal.accuracy.cross_validation.refit import Refit, refit_folds, with_known_stops
from basecal.accuracy.residuals.fit import view_alone
from basecal.accuracy.task.error_map import seen_at
from basecal.cell import LocalFit
from basecal.estimation.solve import Solution
from basecal.geometry import SE3, Array, BoolArray

FEWEST_SAMPLES = 10
"""Of a part: with fewer a local fit has hardly more equations than unknowns."""

MOST_PARTS = 4
"""Of a workspace, each of which takes as long as a cross-validation."""

CHANCE = 0.4
"""By which a local fit that is no better is recommended.

A wrong choice costs as much on either side, so that what predicts better is chosen, but for a doubt: a smaller chance
left local fits aside that were clearly better (benchmarks/local_fits.py).
"""

_ITERATIONS = 30


def local_fits(solution: Solution, asked: Sequence[str]) -> tuple[LocalFit, ...]:
    """Each part of the workspace, with held-out errors of both fits; none where there are too few samples for parts.

    Args:
        solution: The fit of all samples.
        asked: Names of the transforms to tell of the local fits.
    """
    problem = solution.problem
    places = [seen_at(group, solution.state) for group in problem.groups]
    samples = [group.sample for group in problem.groups]
    ways = splits(problem)
    parts = list(_parts(np.concatenate(places), np.concatenate(samples))) if places else []
    if len(parts) < 2 or not ways:
        return ()
    folds = ways[0].folds
    everywhere = refit_folds(problem, solution.state, folds, _ITERATIONS)
    found = []
    for numbers in parts:
        inside = [np.isin(of, numbers) for of in samples]
        own = np.concatenate([at[mine] for at, mine in zip(places, inside, strict=True)])
        centre = own.mean(0)
        reach = float(np.sqrt(np.mean(np.sum((own - centre) ** 2, -1))))
        worth = [np.exp(-0.5 * np.sum((at - centre) ** 2, -1) / reach**2) for at in places]
        local = refit_folds(problem, solution.state, [*folds, frozenset()], _ITERATIONS, worth=worth)
        found.append(_compared(solution, everywhere, local, inside, centre, numbers, asked))
    return tuple(found)


def _parts(places: Array, samples: Array) -> Iterator[Array]:
    """Numbers of samples in parts of about as many, halved along the axis of the base in which they are widest."""
    parts = [np.arange(len(places))]
    while len(parts) < MOST_PARTS:
        widest = max(parts, key=len)
        along = places[widest][:, np.ptp(places[widest], axis=0).argmax()]
        low, high = widest[along <= np.median(along)], widest[along > np.median(along)]
        if min(len(np.unique(samples[low])), len(np.unique(samples[high]))) < FEWEST_SAMPLES:
            break
        parts = [part for part in parts if part is not widest] + [low, high]
    for part in parts:
        yield np.unique(samples[part])


def _compared(
    solution: Solution,
    everywhere: Sequence[Refit],
    local: Sequence[Refit],
    inside: Sequence[BoolArray],
    centre: Array,
    numbers: Array,
    asked: Sequence[str],
) -> LocalFit:
    *held_out, whole = local
    by_all = np.concatenate([_squares(solution, fit, inside) for fit in everywhere])
    by_part = np.concatenate([_squares(solution, fit, inside) for fit in held_out])
    settled = all(fit.optimum.converged for fit in (*everywhere, *local)) and len(by_all) > 1
    gain = by_all - by_part
    spread = float(np.std(gain, ddof=1)) / np.sqrt(len(gain)) if settled else 0.0
    chance = float(student_t.sf(gain.mean() / spread, len(gain) - 1)) if spread > 0 else 1.0
    transforms = {name: whole.optimum.state.transforms[name] for name in asked}
    rms = [float(np.sqrt(squares.mean())) if settled else None for squares in (by_all, by_part)]
    return LocalFit(centre, tuple(map(int, numbers)), rms[0], rms[1], chance, chance < CHANCE, transforms)


def _squares(solution: Solution, fit: Refit, inside: Sequence[BoolArray]) -> Array:
    """Squares of how far the targets of held-out views in a part are from where a fit predicts them [m^2]."""
    state = with_known_stops(fit.optimum.state, fit.known)
    found = [np.zeros(0)]
    for group, mine in zip(solution.problem.groups, inside, strict=True):
        views = group.take(np.flatnonzero(mine & np.isin(group.sample, list(fit.held))))
        if not len(views):
            continue
        by_all: SE3 = solution.state.camera_from_target(views, solution.problem.stops)
        alone, enough = view_alone(solution.state, views, by_all)
        off = alone.inverse() @ state.camera_from_target(views, solution.problem.stops)
        found.append(np.sum(off.translation**2, -1)[enough])
    return np.concatenate(found)
