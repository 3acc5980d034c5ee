"""Damped Gauss-Newton that never takes a step uphill.

Source: Marquardt 1963, with the damping of Nielsen 1999.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from basecal.estimation.normal import Normal, linearise, moved
from basecal.estimation.problem import Problem, State
from basecal.geometry import Array

_SETTLED_SIGMAS = 1e-5
_SMALLEST_STEP = 1e-13
_FIRST_DAMPING = 1e-9
_UNDAMPED = 1e-3
_LARGEST_DAMPING = 1e12
_LARGEST_GAIN = 1e50  # its cube must not overflow


@dataclass(frozen=True, eq=False)
class Descent:
    """Where an iteration ended: the state, the problem about it, and whether it is an optimum."""

    state: State
    normal: Normal
    converged: bool
    iterations: int


def descend(problem: Problem, state: State, dof: int, iterations: int = 100) -> Descent:
    """The optimum downhill of `state`.

    It has converged when what is left after a step, by the rate at which steps shrink, is below 1e-5 of the sigmas
    that the data have left, or below 1e-13 [m, rad]. The problem is given as it stands before that step.

    Args:
        problem: The problem.
        state: Where to start.
        dof: Residuals less unknowns, which scales the sigmas.
        iterations: At most.
    """
    normal = linearise(problem, state)
    damping, growth, before = _FIRST_DAMPING, 2.0, 0.0
    for k in range(iterations):
        scale = normal.cost / max(dof, 1) if np.isfinite(normal.cost) else 1.0
        step = _step(normal, damping)
        expected = float(step @ (normal.hessian @ step))
        left = expected * min(1.0, expected / before) if before > 0 and damping <= _UNDAMPED else expected
        settled = left <= _SETTLED_SIGMAS**2 * scale or float(np.abs(step).max(initial=0.0)) < _SMALLEST_STEP
        candidate = moved(problem, state, normal, step)
        if settled and damping <= _UNDAMPED:
            return Descent(candidate, replace(normal, cost=max(normal.cost - expected, 0.0)), True, k + 1)
        after = linearise(problem, candidate)
        if after.cost <= normal.cost * (1 + 1e-12):
            gain = (normal.cost - after.cost) / max(expected, 1e-300)
            gain = min(max(gain, -_LARGEST_GAIN), _LARGEST_GAIN)
            state, normal, before = candidate, after, max(expected, 1e-300)
            damping, growth = max(damping * max(0.1, 1 - (2 * gain - 1) ** 3), _FIRST_DAMPING), 2.0
        elif settled:
            return Descent(state, normal, True, k + 1)
        else:
            damping, growth = max(damping, 1e-6) * growth, growth * 2
            if damping > _LARGEST_DAMPING:
                break
    return Descent(state, normal, False, iterations)


def _step(normal: Normal, damping: float) -> Array:
    diagonal = np.diag(normal.hessian)
    scale = 1 / np.sqrt(np.maximum(diagonal, 1e-12 * diagonal.max(initial=1e-300)))
    scaled = normal.hessian * scale * scale[:, None]
    scaled[np.diag_indices_from(scaled)] += damping
    step: Array = -scale * np.linalg.solve(scaled, scale * normal.gradient)
    return step
