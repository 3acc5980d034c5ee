"""States from subsets of the samples: consecutive blocks and random subsets; for a single LED, from all its starts.

A bumped arm affects all later samples, a detector error any sample. Each state is refitted to the views that it
explains best. Source: Fischler & Bolles 1981; Rousseeuw & Van Driessen 1999 (concentration).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from typing import TypeVar

import numpy as np

from basecal.cell import Cell, Intrinsics
from basecal.estimation.least_squares.bundle_adjustment import batch_states, bundle_adjust_batch
from basecal.estimation.least_squares.studentized_residuals import view_misfits
from basecal.estimation.noise.estimate import degrees_of_freedom
from basecal.estimation.outliers.inlier_mask import select_samples
from basecal.estimation.problem.correspondence import choose_correspondence
from basecal.estimation.problem.problem import Problem, State, sequential_columns
from basecal.estimation.start.first_state import first_states, led_states, lenses
from basecal.geometry import Camera, IntArray
from basecal.numerics.batch import take

_BLOCKS = (2, 3)  # halves and thirds, since a bump affects all later samples
_DRAWS = 24  # random subsets: with four samples each and a third of bad samples, one is clean with 99 % probability
# Number of subsets that are processed as a batch: one of the first may already be convincing.
_BATCH_SUBSETS = 8
_LED_STARTS = 40  # starts of an LED among reflections; validated by benchmarks.outliers
_RESERVE_RATIO = 1.3  # ratio of the size of a subset to the number of samples that could determine every unknown
_CONCENTRATIONS = 3  # rounds of concentration; Rousseeuw & Van Driessen continue with the best states alone
_CONCENTRATED_SHARE = 0.5  # share of views in a concentration: at least half are inliers
_DESCENT_STEPS = 30  # maximum number of steps of a descent from a start
_FARTHEST = 1e30  # larger squared deviations are clipped
_FEW_STEPS = 4  # steps between two selections of views
_SEED = 20240301  # arbitrary

T = TypeVar("T")


def subset_states(problem: Problem, cell: Cell, first: State) -> Iterator[State]:
    """Yield states from `first`, from the starts of a single LED, and from subsets of the samples, in this order."""
    problem = _with_lenses(problem, lenses(problem, cell))
    yield from _process_batch(lambda states: _concentrate(problem, states), [first])
    yield from led_states(problem, cell, _LED_STARTS)
    subsets = _subsets(problem, problem.samples)
    # Each is fitted to its own samples and then refitted to the views that it explains best.
    while batch := list(islice(subsets, _BATCH_SUBSETS)):
        fitted = _process_batch(lambda starts: _fit_subsets(problem, starts), _start_subsets(problem, cell, batch))
        yield from _process_batch(lambda states: _concentrate(problem, states), fitted)


def score(problem: Problem, state: State, uses_stated_noise: bool) -> float:
    """Robust cost of a state over all views; lower is better.

    It is the negative log of a Cauchy likelihood with an optimised scale, which is at least one for stated sigmas.
    """
    by_group = view_misfits(problem, state)
    value = np.minimum(np.concatenate([s.value for s in by_group]), _FARTHEST)
    freedoms = np.concatenate([s.freedoms for s in by_group])
    has_freedoms = freedoms > 0
    if not has_freedoms.any():
        return np.inf
    ratio, half = value[has_freedoms] / freedoms[has_freedoms], 0.5 * freedoms[has_freedoms]
    scales = np.maximum(np.quantile(ratio, np.linspace(0.1, 0.9, 17)), 1.0 if uses_stated_noise else 1e-12)
    return min(float(np.sum(half * np.log(s) + (half + 0.5) * np.log1p(2 * half * ratio / s))) for s in scales)


def _with_lenses(problem: Problem, cameras: Mapping[str, Camera]) -> Problem:
    """Return the problem with fixed lenses: with few samples, a free lens would absorb the error of a wrong pose."""
    fixed = {name: Intrinsics("fixed", camera) for name, camera in cameras.items()}
    widths = {name: problem.column_width(name) for name in problem.columns if name not in fixed}
    return replace(problem, lenses=fixed, columns=sequential_columns(widths))


def _subsets(problem: Problem, numbers: IntArray) -> Iterator[IntArray]:
    for count in _BLOCKS:
        yield from np.array_split(numbers, count)
    size = _subset_size(problem, numbers)
    rng = np.random.default_rng(_SEED)
    for _ in range(_DRAWS):
        yield np.sort(rng.choice(numbers, size, replace=False))


def _subset_size(problem: Problem, numbers: IntArray) -> int:
    """Number of samples of a random subset: enough to determine every unknown, with a reserve."""
    needed = _RESERVE_RATIO * problem.width / max(problem.equation_count / len(numbers), 1e-9)
    return int(min(max(np.ceil(needed), 3), len(numbers)))


@dataclass(frozen=True, eq=False)
class _Subset:
    """Numbers of some samples, their degrees of freedom, and their start."""

    numbers: IntArray
    dof: int
    start: State


def _process_batch(work: Callable[[Sequence[T]], list[State]], items: Sequence[T]) -> list[State]:
    """Process items as one batch; if the solve fails, split the batch and drop the items that fail."""
    if not items:
        return []
    try:
        return work(items)
    except np.linalg.LinAlgError:
        half = len(items) // 2
        return [*_process_batch(work, items[:half]), *_process_batch(work, items[half:])] if half else []


def _start_subsets(problem: Problem, cell: Cell, numbers: Iterable[IntArray]) -> list[_Subset]:
    """Find starts of subsets; drop subsets with too few residuals or without a start."""
    parts = [(subset, select_samples(problem, subset)) for subset in numbers]
    parts = [(subset, part) for subset, part in parts if part.groups and degrees_of_freedom(part) >= 0]
    starts = first_states([part for _, part in parts], cell, thorough=False)
    return [
        _Subset(subset, max(degrees_of_freedom(part), 1), start)
        for (subset, part), start in zip(parts, starts, strict=True)
        if isinstance(start, State)
    ]


def _fit_subsets(problem: Problem, subsets: Sequence[_Subset]) -> list[State]:
    """Fit each start to its own samples, as one batch; drop fits whose cost is not finite."""
    masks = [np.stack([np.isin(g.sample, subset.numbers) for subset in subsets]) for g in problem.groups]
    states = batch_states(problem, [subset.start for subset in subsets])
    problem, _ = choose_correspondence(problem, states)
    dof, weights = np.array([subset.dof for subset in subsets]), [mask.astype(np.float64) for mask in masks]
    fits = bundle_adjust_batch(problem, states, dof, _DESCENT_STEPS, weights)
    return [take(fits.state, int(k)) for k in np.flatnonzero(np.isfinite(fits.cost))]


def _concentrate(problem: Problem, states: Sequence[State]) -> list[State]:
    """Refit states repeatedly to the half of the views that each explains best, as one batch."""
    batch = batch_states(problem, states)
    for _ in range(_CONCENTRATIONS):
        reread, _ = choose_correspondence(problem, batch)
        squares = view_misfits(reread, batch)
        ratio = [np.minimum(s.value, _FARTHEST) / np.maximum(s.freedoms, 1) for s in squares]
        limit = np.quantile(np.concatenate(ratio, axis=-1), _CONCENTRATED_SHARE, axis=-1)
        weights = [(r <= limit[:, None]).astype(np.float64) for r in ratio]
        batch = bundle_adjust_batch(reread, batch, 1, _FEW_STEPS, weights).state
    return [take(batch, k) for k in range(len(states))]
