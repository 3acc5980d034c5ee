"""Damped Gauss-Newton that never takes a step uphill.

Source: Marquardt 1963, with the damping of Nielsen 1999.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from basecal.estimation.least_squares.normal_equations import NormalEquations, linearise, retract
from basecal.estimation.problem.problem import Problem, State
from basecal.geometry import Array

_SETTLED_SIGMAS = 1e-5
_STRAIGHT_SIGMAS = 1e-3
_SMALLEST_STEP = 1e-13
_FIRST_DAMPING = 1e-9
_UNDAMPED = 1e-3
_LARGEST_DAMPING = 1e12
_LARGEST_GAIN = 10.0


@dataclass(frozen=True, eq=False)
class Optimum:
    """Where an iteration ended: the state, the problem about it, and whether it is an optimum."""

    state: State
    normal: NormalEquations
    converged: bool
    iterations: int


def levenberg_marquardt(
    problem: Problem, state: State, dof: int, iterations: int = 100, weights: Sequence[Array] | None = None
) -> Optimum:
    """The optimum downhill of `state`.

    It has converged when what is left after a step, by the rate at which steps shrink, is below 1e-5 of the sigmas
    that the data have left, or below 1e-13 [m, rad]; where stops have errors, which no step shows, the step before must
    have lowered the cost as predicted besides, to 1e-3 of a sigma. The problem is given as it stands before that step.

    Args:
        problem: The problem.
        state: Where to start.
        dof: Residuals less unknowns, which scales the sigmas.
        iterations: At most.
        weights: What each view counts, (n,) by group; 1 where None.
    """
    normal = linearise(problem, state, weights)
    damping, growth, before = _FIRST_DAMPING, 2.0, 0.0
    has_stops = len(problem.stops) > 0
    bent = np.inf if has_stops else 0.0
    for k in range(iterations):
        scale = normal.cost / max(dof, 1) if np.isfinite(normal.cost) else 1.0
        step = _step(normal, damping)
        expected = float(step @ (normal.hessian @ step))
        left = expected * min(1.0, expected / before) if before > 0 and damping <= _UNDAMPED else expected
        near = left <= _SETTLED_SIGMAS**2 * scale and bent <= _STRAIGHT_SIGMAS**2 * scale
        settled = near or float(np.abs(step).max(initial=0.0)) < _SMALLEST_STEP
        candidate = retract(problem, state, normal, step)
        if settled and damping <= _UNDAMPED:
            return Optimum(candidate, replace(normal, cost=max(normal.cost - expected, 0.0)), True, k + 1)
        after = _linearised(problem, candidate, weights)
        if after is not None and after.cost <= normal.cost * (1 + 1e-12):
            gain = float(np.clip((normal.cost - after.cost) / max(expected, 1e-300), -_LARGEST_GAIN, _LARGEST_GAIN))
            bent = abs(normal.cost - expected - after.cost) if has_stops else 0.0
            state, normal, before = candidate, after, max(expected, 1e-300)
            damping, growth = max(damping * max(0.1, 1 - (2 * gain - 1) ** 3), _FIRST_DAMPING), 2.0
        elif settled:
            return Optimum(state, normal, True, k + 1)
        else:
            damping, growth = max(damping, 1e-6) * growth, growth * 2
            if damping > _LARGEST_DAMPING:
                break
    return Optimum(state, normal, False, iterations)


def _linearised(problem: Problem, state: State, weights: Sequence[Array] | None) -> NormalEquations | None:
    """The problem about a state; None where that is beyond numbers, as with a point next to its camera's centre."""
    try:
        return linearise(problem, state, weights)
    except np.linalg.LinAlgError:
        return None


def _step(normal: NormalEquations, damping: float) -> Array:
    diagonal = np.diag(normal.hessian)
    scale = 1 / np.sqrt(np.maximum(diagonal, 1e-12 * diagonal.max(initial=1e-300)))
    scaled = normal.hessian * scale * scale[:, None]
    scaled[np.diag_indices_from(scaled)] += damping
    step: Array = -scale * np.linalg.solve(scaled, scale * normal.gradient)
    return step
