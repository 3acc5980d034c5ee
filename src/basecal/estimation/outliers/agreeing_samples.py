"""Which samples close the loop with one another, if they are too few, or too similar, for a solution.

`benchmarks.outliers` judges its limits.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from basecal.estimation.least_squares.studentized_residuals import studentize_views
from basecal.estimation.problem.problem import Problem, State
from basecal.geometry import Array, IntArray

CLEAR_GAP = 5.0
"""Factor in sigmas between neighbours: noise leaves no such gap."""

_LEAST_SHARE, _MOST_SHARE = 0.3, 0.8  # of the samples: a gap outside the middle is the tail of noise
_FARTHEST = 1e15  # misfits beyond are alike [sigma]


def agreeing_samples(problem: Problem, states: Iterable[State]) -> tuple[int, ...]:
    """Numbers of the samples that a state explains far better than the rest, by the state that explains them best.

    Between the last of them and the first of the rest, misfits in sigmas grow by a factor of five at least. None are
    returned if no state shows such a gap between 30 % and 80 % of the samples.
    """
    found: tuple[float, tuple[int, ...]] = (np.inf, ())
    numbers, row = np.unique(np.concatenate([g.sample for g in problem.groups]), return_inverse=True)
    for state in states:
        squares = studentize_views(problem, state)
        sigmas = np.sqrt(np.concatenate([s.value / np.maximum(s.freedoms, 1) for s in squares]))
        worst = np.zeros(len(numbers))  # view of each sample
        np.maximum.at(worst, row, sigmas)
        found = min(found, _split_at_gap(numbers, worst), key=lambda f: f[0])
    return found[1]


def _split_at_gap(numbers: IntArray, sigmas: Array) -> tuple[float, tuple[int, ...]]:
    """The largest misfit before the first clear gap of the sorted ones, and the samples up to there."""
    order = np.argsort(sigmas, kind="stable")
    ordered = np.clip(sigmas[order], 1.0, _FARTHEST)
    first, last = int(np.ceil(_LEAST_SHARE * len(order))), int(_MOST_SHARE * len(order))
    gaps = np.flatnonzero(ordered[first : last + 1] > CLEAR_GAP * ordered[first - 1 : last])
    if not len(gaps):
        return np.inf, ()
    count = first + int(gaps[0])
    return float(ordered[count - 1]), tuple(sorted(int(n) for n in numbers[order[:count]]))
