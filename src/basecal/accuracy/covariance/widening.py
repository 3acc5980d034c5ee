"""Covariances beyond noise: for the difference to an alternative solution, and for curved equations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from basecal.estimation.least_squares.normal_equations import linearise, retract
from basecal.estimation.noise.neighbourhoods import uses_neighbourhoods
from basecal.estimation.observability.observability import column_scales
from basecal.estimation.problem.problem import Problem, State
from basecal.estimation.solve import Solution
from basecal.geometry import Array, IntArray
from basecal.numerics.batch import concatenate, take
from basecal.numerics.spectral import scaled_spectrum, spectrum


def state_step(problem: Problem, first: State, second: State) -> Array:
    """Step from one state to another in the columns of transforms and lenses, (p,); 0 in all other columns.

    Distortion terms that the first lens lacks count as 0 in the first state.
    """
    step = np.zeros(problem.width)
    for name, where in problem.columns.items():
        if name in first.transforms:
            tangent = (first.transforms[name].inverse() @ second.transforms[name]).log()
            step[where] = tangent[: where.stop - where.start]
        elif name in first.cameras:
            step[where] = second.cameras[name].parameters
            known = first.cameras[name].parameters
            step[where.start : where.start + len(known)] -= known
    return step


def largest_shift(solution: Solution, shifts: Sequence[Array]) -> Array:
    """Return the shift of the columns, (p,), with the largest Mahalanobis distance."""
    known = spectrum(solution.covariance)
    return max(shifts, key=lambda shift: float(known.squared_mahalanobis(shift)))


def widen(solution: Solution, shift: Array) -> Solution:
    """Widen the covariance of a solution to cover an alternative solution at a distance `shift`, (p,)."""
    return replace(solution, covariance=solution.covariance + np.outer(shift, shift))


_MAX_STEPS = 4  # of Gauss-Newton: for sigmas of degrees, each step is at most a twentieth of the previous one
_LEAST_STEP = 0.1  # in sigmas: the next step, of 0.005, changes no digit of a covariance
# Factor on the sigma of a product of two normals for its long tails: a 99 % ellipsoid then holds 98.9 %, not 96.7 %.
_TAILS = 2.0
_LEAST_SHARE = 0.1  # of the smallest sigma: smaller deviations of an arc from its tangent are neglected
_AT_ONCE = 16  # states: the arrays of more do not fit into the processor's cache
_MOST_DIRECTIONS = 8  # those of the largest sigmas, to limit the number of pairs


class _Directions(NamedTuple):
    """Principal directions of a covariance.

    Attributes:
        steps: (p, m) step of one sigma along each direction.
        wide: (k,) indices of directions with significant second-order curvature.
        pairs: (2, q) pairs of indices into `wide` with significant mixed curvature.
    """

    steps: Array
    wide: IntArray
    pairs: IntArray


def curved_covariance(solution: Solution, order: Sequence[str]) -> Array:
    """Second moments of the deviations of named transforms from their tangents, (6 n, 6 n) [m, rad].

    If a first joint has a sigma of degrees, the base moves along an arc. The arc deviates from its tangent by more than
    the sigmas across it. At z_i sigmas along the directions of largest sigma, the best state deviates from their
    tangents by the sum of q_ij z_i z_j. The second moments of this sum are returned. Source: docs/mathematics.md (7.1).
    """
    directions = None if uses_neighbourhoods(solution.problem) else _directions(solution, order)
    if directions is None or not len(directions.wide):
        return np.zeros((6 * len(order), 6 * len(order)))
    count = len(directions.wide)
    first, second = directions.pairs
    ahead = np.zeros((count + len(first), directions.steps.shape[1]))
    ahead[np.arange(count), directions.wide] = 1.0
    ahead[count:] = ahead[first] + ahead[second]
    zero = np.zeros((1, ahead.shape[1]))  # descents end near the optimum: this error is subtracted
    sigmas = np.concatenate([zero, ahead, -ahead])
    parts = [
        _best_states(solution, sigmas[row : row + _AT_ONCE], directions.steps)
        for row in range(0, len(sigmas), _AT_ONCE)
    ]
    found = [part for part in parts if part is not None]
    if len(found) < len(parts):  # unobservable directions lead to infinite states; such solutions are refused
        return np.zeros((6 * len(order), 6 * len(order)))
    states = concatenate(found)
    transforms = solution.state.transforms
    deviations = np.concatenate(
        [(transforms[name].inverse() @ states.transforms[name]).log() for name in order], axis=1
    )
    own, pairs = np.split(0.5 * np.add(*np.split(deviations[1:], 2)) - deviations[0], [count])
    shared, mean = pairs - own[first] - own[second], own.sum(0)
    return np.asarray(_TAILS**2 * (np.outer(mean, mean) + 2 * own.T @ own + shared.T @ shared))


def _directions(solution: Solution, order: Sequence[str]) -> _Directions:
    """Directions whose second-order curvature may exceed a share of the smallest sigma of a transform."""
    columns = [solution.problem.columns[name] for name in order if name in solution.problem.columns]
    scale = column_scales(solution.problem, solution.state, solution.observability.length_m)
    # Errors that stops share widen the covariance, but are not unknowns of the equations that are minimised.
    equations = linearise(solution.noise.hold_sigmas(solution.problem), solution.state)
    covariance = solution.noise.factor * spectrum(equations.hessian).inverse
    spectral = scaled_spectrum(covariance, 0.0, scale)
    blocks = [scaled_spectrum(covariance[at, at], 0.0, scale[at]) for at in columns]
    least = min(
        (float(np.sqrt(block.values[block.is_informative].min(initial=np.inf))) for block in blocks), default=np.inf
    )
    sigmas = np.sqrt(spectral.values[spectral.is_informative])
    wide = np.flatnonzero(sigmas * sigmas.max(initial=0.0) > _LEAST_SHARE * least)[-_MOST_DIRECTIONS:]
    is_pair = np.triu(np.outer(sigmas[wide], sigmas[wide]) > _LEAST_SHARE * least, 1)
    return _Directions(spectral.root[:, spectral.is_informative], wide, np.array(np.nonzero(is_pair)))


def _best_states(solution: Solution, sigmas: Array, steps: Array) -> State | None:
    """Minimise the cost at fixed sigmas along directions, (b, m); directions of zero sigmas are free.

    Returns:
        The states, or None if one is not finite.
    """
    problem, unit = solution.noise.hold_sigmas(solution.problem), np.eye(steps.shape[1])
    start, row, ends = solution.state.repeat(problem, len(sigmas)), np.arange(len(sigmas)), []
    state = retract(problem, start, linearise(problem, solution.state), sigmas @ steps.T)
    for _ in range(_MAX_STEPS):
        normal, is_free = linearise(problem, state), sigmas[row] == 0
        hessian = np.where(is_free[:, None] & is_free[..., None], steps.T @ normal.hessian @ steps, unit)
        if not np.isfinite(hessian).all():
            return None
        step = -(spectrum(hessian).inverse @ (is_free * (normal.gradient @ steps))[..., None])[..., 0]
        state = retract(problem, state, normal, step @ steps.T)
        goes_on = np.abs(step).max(-1) >= _LEAST_STEP
        ends.append((row[~goes_on], take(state, ~goes_on)))
        row, state = row[goes_on], take(state, goes_on)
        if not len(row):
            break
    rows, states = concatenate([*ends, (row, state)])
    return take(states, np.argsort(rows))
