"""States from some of the samples alone: blocks that follow one another, and random ones; of a light, from all starts.

What a bumped arm spoils it spoils from then on; what a detector spoils is anywhere. Each state is drawn on to the views
that it explains best. Source: Fischler & Bolles 1981; Rousseeuw & Van Driessen 1999 (concentration).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np

from basecal.cell import Cell, Intrinsics
from basecal.errors import BasecalError
from basecal.estimation.least_squares.bundle_adjustment import bundle_adjust
from basecal.estimation.least_squares.studentized import MahalanobisSquared, studentized
from basecal.estimation.noise.estimate import degrees_of_freedom
from basecal.estimation.outliers.inlier_mask import of_samples
from basecal.estimation.problem.correspondence import choose_correspondence
from basecal.estimation.problem.problem import Problem, State
from basecal.estimation.start.first_state import first_state, lenses, light_states
from basecal.geometry import Camera, IntArray

_BLOCKS = (2, 3)
_DRAWS = 24
_LIGHT_STARTS = 40
_SPARE = 1.3
_CONCENTRATIONS = 3
_CONCENTRATED = 0.5
_STEPS = 30
_FARTHEST = 1e30
_FEW_STEPS = 4
_SEED = 20240301


def subset_states(problem: Problem, cell: Cell, first: State) -> Iterator[State]:
    """States that some samples alone lead to, after that which `first` leads to, as many as are worth their time."""
    problem = _with_lenses(problem, lenses(problem, cell))
    concentrated = _concentrated(problem, first)
    if concentrated is not None:
        yield concentrated
    yield from light_states(problem, cell, _LIGHT_STARTS)
    numbers = np.unique(np.concatenate([g.sample for g in problem.groups]))
    for few in _subsets(problem, numbers):
        state = _state_of(problem, cell, few)
        if state is not None:
            yield state


def score(problem: Problem, state: State, stated: bool) -> float:
    """How badly a state explains the views, whatever a few of them say: less is better.

    The Cauchy likelihood with its own scale, which is at least one where sigmas are stated.
    """
    every = studentized(problem, state)
    value = np.minimum(np.concatenate([s.value for s in every]), _FARTHEST)
    freedoms = np.concatenate([s.freedoms for s in every])
    seen = freedoms > 0
    return _cauchy(MahalanobisSquared(value[seen], freedoms[seen]), stated)


def _cauchy(squares: MahalanobisSquared, stated: bool) -> float:
    if not len(squares.value):
        return np.inf
    ratio = squares.value / squares.freedoms
    scales = np.maximum(np.quantile(ratio, np.linspace(0.1, 0.9, 17)), 1.0 if stated else 1e-12)
    half = 0.5 * squares.freedoms
    costs = [float(np.sum(half * np.log(s) + (half + 0.5) * np.log1p(2 * half * ratio / s))) for s in scales]
    return min(costs)


def _with_lenses(problem: Problem, cameras: Mapping[str, Camera]) -> Problem:
    """The problem with every lens known: few samples would rather bend it than give up a wrong pose."""
    known = {name: Intrinsics("fixed", camera) for name, camera in cameras.items()}
    widths = {name: c.stop - c.start for name, c in problem.columns.items() if name not in known}
    ends = np.cumsum([0, *widths.values()])
    columns = {name: slice(int(a), int(b)) for name, a, b in zip(widths, ends[:-1], ends[1:], strict=True)}
    return replace(problem, lenses=known, columns=columns)


def _subsets(problem: Problem, numbers: IntArray) -> Iterator[IntArray]:
    for count in _BLOCKS:
        yield from np.array_split(numbers, count)
    size = _size(problem, numbers)
    rng = np.random.default_rng(_SEED)
    for _ in range(_DRAWS):
        yield np.sort(rng.choice(numbers, size, replace=False))


def _size(problem: Problem, numbers: IntArray) -> int:
    """The fewest samples that could hold every unknown, and some to spare."""
    equations = sum(int(g.measurement.equations().sum()) for g in problem.groups)
    needed = _SPARE * problem.width / max(equations / len(numbers), 1e-9)
    return int(min(max(np.ceil(needed), 3), len(numbers)))


def _state_of(problem: Problem, cell: Cell, numbers: IntArray) -> State | None:
    few = of_samples(problem, numbers)
    if not few.groups or degrees_of_freedom(few) < 0:
        return None
    try:
        start = first_state(few, cell, thorough=False)
        few, _ = choose_correspondence(few, start)
        end = bundle_adjust(few, start, max(degrees_of_freedom(few), 1), _STEPS)
    except (BasecalError, np.linalg.LinAlgError):
        return None
    return _concentrated(problem, end.state) if np.isfinite(end.cost) else None


def _concentrated(problem: Problem, state: State) -> State | None:
    """Drawn on to the views that fit best."""
    for _ in range(_CONCENTRATIONS):
        problem, _ = choose_correspondence(problem, state)
        try:
            squares = studentized(problem, state)
        except np.linalg.LinAlgError:
            return None
        ratio = [np.minimum(s.value, _FARTHEST) / np.maximum(s.freedoms, 1) for s in squares]
        limit = np.quantile(np.concatenate(ratio), _CONCENTRATED)
        weights = [(r <= limit).astype(np.float64) for r in ratio]
        state = bundle_adjust(problem, state, 1, _FEW_STEPS, weights).state
    return state
