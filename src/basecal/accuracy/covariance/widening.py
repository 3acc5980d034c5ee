"""Covariances wider than that of noise: of an answer beside another one, and of equations that are curved."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from basecal.estimation.least_squares.normal_equations import linearise, retract
from basecal.estimation.noise.neighbourhoods import goes_by_neighbourhoods
from basecal.estimation.observability.observability import column_scales
from basecal.estimation.problem.problem import Problem, State
from basecal.estimation.solve import Solution
from basecal.geometry import Array, IntArray
from basecal.numerics.spectral import scaled_spectrum, spectrum


def state_step(problem: Problem, first: State, second: State) -> Array:
    """The step from one state to another in the columns of transforms and lenses, (p,); 0 in all others.

    Distortion terms that a lens lacks before are 0 there.
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


def largest_shift(solution: Solution, moves: Sequence[Array]) -> Array:
    """The largest of several shifts of the columns, each (p,), in units of the covariance."""
    known = spectrum(solution.covariance)
    return max(moves, key=lambda moved: float(known.squared_mahalanobis(moved)))


def widen(solution: Solution, shift: Array) -> Solution:
    """A solution whose covariance covers the answer with columns that are so much aside, (p,), too."""
    return replace(solution, covariance=solution.covariance + np.outer(shift, shift))


_MAX_STEPS = 4  # of Gauss-Newton: where sigmas are degrees, each is at most a twentieth of the one before
_LEAST_STEP = 0.1  # in sigmas: the next step, of 0.005, changes no digit of a covariance
# Over the sigma of a product of two normals, whose tails are long: then an ellipsoid of 99 % holds 98.9 %, not 96.7 %.
_TAILS = 2.0
_LEAST_SHARE = 0.1  # of the smallest sigma, by which an arc leaves its tangent before it counts
_MOST_DIRECTIONS = 8  # the least known, so that their pairs stay few


class _Directions(NamedTuple):
    """Principal directions of a covariance.

    Attributes:
        steps: (p, m) of a sigma along each.
        wide: (k,) those whose arcs may leave their tangents.
        pairs: (2, q) places in `wide` of two that do so together.
    """

    steps: Array
    wide: IntArray
    pairs: IntArray


def curved_covariance(solution: Solution, order: Sequence[str]) -> Array:
    """Second moments of what transforms of these names are off their tangents, (6 n, 6 n) [m, rad].

    A first joint that is known to degrees moves a base along an arc, which leaves its tangent by more than the sigmas
    across it. At z_i sigmas along the least known directions the best state is off their tangents by the sum of
    q_ij z_i z_j. The second moments of that sum are added. Source: docs/mathematics.md (7.1).
    """
    directions = None if goes_by_neighbourhoods(solution.problem) else _directions(solution, order)
    if directions is None or not len(directions.wide):
        return np.zeros((6 * len(order), 6 * len(order)))
    count = len(directions.wide)
    first, second = directions.pairs
    ahead = np.zeros((count + len(first), directions.steps.shape[1]))
    ahead[np.arange(count), directions.wide] = 1.0
    ahead[count:] = ahead[first] + ahead[second]
    nowhere = np.zeros((1, ahead.shape[1]))  # descents end anywhere within a share of a sigma: that is no curvature
    states = _best_states(solution, np.concatenate([nowhere, ahead, -ahead]), directions.steps)
    if states is None:  # directions that nothing tells lead to infinity: they are refused
        return np.zeros((6 * len(order), 6 * len(order)))
    at = solution.state.transforms
    off = np.concatenate([(at[name].inverse() @ states.transforms[name]).log() for name in order], axis=1)
    own, pairs = np.split(0.5 * np.add(*np.split(off[1:], 2)) - off[0], [count])
    shared, mean = pairs - own[first] - own[second], own.sum(0)
    return np.asarray(_TAILS**2 * (np.outer(mean, mean) + 2 * own.T @ own + shared.T @ shared))


def _directions(solution: Solution, order: Sequence[str]) -> _Directions:
    """The directions whose arcs may leave their tangents by a share of the smallest sigma of a transform."""
    columns = [solution.problem.columns[name] for name in order if name in solution.problem.columns]
    scale = column_scales(solution.problem, solution.state, solution.observability.length_m)
    # Errors that stops share widen the covariance, but are none of the equations whose best states are looked for.
    equations = linearise(solution.noise.hold_sigmas(solution.problem), solution.state)
    covariance = solution.noise.factor * spectrum(equations.hessian).inverse
    of = scaled_spectrum(covariance, 0.0, scale)
    blocks = [scaled_spectrum(covariance[at, at], 0.0, scale[at]) for at in columns]
    least = min((float(np.sqrt(block.values[block.held].min(initial=np.inf))) for block in blocks), default=np.inf)
    sigmas = np.sqrt(of.values[of.held])
    wide = np.flatnonzero(sigmas * sigmas.max(initial=0.0) > _LEAST_SHARE * least)[-_MOST_DIRECTIONS:]
    together = np.triu(np.outer(sigmas[wide], sigmas[wide]) > _LEAST_SHARE * least, 1)
    return _Directions(of.root[:, of.held], wide, np.array(np.nonzero(together)))


def _best_states(solution: Solution, sigmas: Array, steps: Array) -> State | None:
    """The states of least cost so many sigmas along directions, (b, m), those of none being free; None at infinity."""
    problem = solution.noise.hold_sigmas(solution.problem)
    start, is_free, unit = solution.state.spread(problem, len(sigmas)), sigmas == 0, np.eye(steps.shape[1])
    state = retract(problem, start, linearise(problem, solution.state), sigmas @ steps.T)
    for _ in range(_MAX_STEPS):
        normal = linearise(problem, state)
        hessian = np.where(is_free[:, None] & is_free[..., None], steps.T @ normal.hessian @ steps, unit)
        if not np.isfinite(hessian).all():
            return None
        back = -(spectrum(hessian).inverse @ (is_free * (normal.gradient @ steps))[..., None])[..., 0]
        state = retract(problem, state, normal, back @ steps.T)
        if np.abs(back).max() < _LEAST_STEP:
            break
    return state
