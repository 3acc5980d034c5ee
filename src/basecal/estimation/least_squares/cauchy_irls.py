"""Iteratively reweighted least squares by Cauchy's likelihood over views, whose weights never end at zero.

Source: Holland & Welsch 1977.
"""

from __future__ import annotations

import numpy as np

from basecal.estimation.least_squares.bundle_adjustment import bundle_adjust_batch
from basecal.estimation.least_squares.studentized_residuals import studentize_views
from basecal.estimation.problem.problem import Problem, State
from basecal.geometry import Array

_HEAVY_ROUNDS = 25  # rounds at most
_FIRST_STEPS = 3  # steps before the first weights: the start is rough
_SCALE_SHARE = 0.6  # of the views set the scale: three tenths may be reflections and still be outvoted


def cauchy_irls(problem: Problem, states: State) -> State:
    """The states of Cauchy's likelihood over views, downhill of a batch of states, each of its own scale.

    The scale is that of six tenths of the views. Where a state is not finite all stay where they are by then.
    """
    weights: list[Array] | None = None
    for _ in range(_HEAVY_ROUNDS):
        try:
            states = bundle_adjust_batch(problem, states, 1, _FIRST_STEPS if weights is None else 1, weights).state
            ratios = [np.minimum(s.value, 1e30) / np.maximum(s.freedoms, 1) for s in studentize_views(problem, states)]
        except np.linalg.LinAlgError:
            break
        scale = np.maximum(np.quantile(np.concatenate(ratios, -1), _SCALE_SHARE, axis=-1, keepdims=True), 1e-30)
        weights = [1 / (1 + ratio / scale) for ratio in ratios]
    return states
