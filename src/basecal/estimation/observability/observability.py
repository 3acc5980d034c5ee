"""Which directions of the unknowns are observable.

The information is scaled to lengths of the scene and radians. A direction whose sigma would be above a third of
these is unobservable; one without any information at all gets no number.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from basecal.cell import Unknown
from basecal.effects.registry import ROBOT_PARAMETERS
from basecal.estimation.least_squares.normal_equations import linearise, prior_equations
from basecal.estimation.observability.motions import null_directions
from basecal.estimation.observability.null_space import NullDirection, separate_null_space
from basecal.estimation.problem.problem import Problem, State
from basecal.estimation.view.points import PointMeasurement
from basecal.geometry import Array
from basecal.numerics.sparse_hessian import SparseHessian
from basecal.numerics.spectral import Spectrum, scaled_spectrum, spectrum

# [m, rad] of a direction: larger, no linear theory of it holds: a sine is off by 1.5 % there; assumed.
UNOBSERVABLE_SIGMA = 0.3
_NO_INFORMATION_SIGMA = 30.0  # [m, rad]: so wide a direction has no information but rounding
TOUCHED_SHARE = 1e-3
"""Share of a null direction in an unknown above which it belongs to it: a square of a millionth, far above rounding."""
_SMALLEST_FACTOR = 1e-4  # noise estimated from exact data counts as a hundredth of a sigma at least; assumed
_DISTORTION_SCALE = 10.0  # a distortion term of 10 is as far off as a radian; assumed
_PRIOR_SHARE = 0.5  # of an eigenvalue that priors make: rounding, which makes the rest, has either sign
_ENOUGH_VIEWS = 40  # views by which the shape of null directions is found; assumed


@dataclass(frozen=True, eq=False)
class Observability:
    """Which unknowns the data determine.

    Attributes:
        inverse: (p, p) inverse of the information, zero along directions without any.
        condition: Largest over smallest scaled sigma; infinite if a direction has no information.
        null_space: The directions whose sigma is too large to count as seen, taken apart.
        unobservable: Names of the transforms and lenses that have such a direction.
        onto_held: (p, p) what takes out of a step its part along directions without any information.
        length_m: What a sigma of a translation is compared with: how far targets are from cameras.
    """

    inverse: Array
    condition: float
    null_space: tuple[NullDirection, ...]
    unobservable: frozenset[str]
    onto_held: Array
    length_m: float = 1.0


def analyse_observability(problem: Problem, state: State, hessian: Array, factor: float) -> Observability:
    """Observability of the unknowns by an information matrix (p, p), whose inverse times `factor` is the covariance."""
    if not len(hessian):
        return Observability(np.zeros((0, 0)), 1.0, (), frozenset(), np.zeros((0, 0)))
    length = _length(problem, state)
    scale = column_scales(problem, state, length)
    noise = max(factor, _SMALLEST_FACTOR)
    of = _information_spectrum(problem, state, hessian, noise / _NO_INFORMATION_SIGMA**2, scale)
    values, vectors, singular = of.values, of.vectors, ~of.held
    inverse = of.inverse
    onto_held = of.inverse_root @ of.root.T
    lenses = [where for name, where in problem.columns.items() if name in problem.lenses]
    distortion = [k for where in lenses for k in range(where.start + 4, where.stop)]
    shaping = np.linalg.norm(vectors[distortion], axis=0) ** 2 > 0.5
    null = singular | ((values < noise / UNOBSERVABLE_SIGMA**2) & ~shaping)
    directions = separate_null_space(problem, state, vectors[:, null], scale) if np.any(null) else ()
    names = frozenset(
        name
        for name, where in problem.columns.items()
        if np.abs(vectors[where][:, singular]).max(initial=0.0) > TOUCHED_SHARE
        or np.sqrt(noise * np.diag(inverse)[where] / scale[where] ** 2)[: _required_columns(problem, name)].max(
            initial=0.0
        )
        > UNOBSERVABLE_SIGMA
    )
    condition = float(np.sqrt(values[-1] / values[0])) if not np.any(singular) else float("inf")
    return Observability(inverse, condition, directions, names, onto_held, length)


def sparse_observability(problem: Problem, state: State, hessian: SparseHessian, factor: float) -> Observability | None:
    """As `analyse_observability` where every direction is seen; None if it is not, or motions leave one open."""
    condition = condition_number(problem, state, hessian, factor)
    if condition is None:
        return None
    inverse, length = hessian.inverse_block(np.arange(problem.width)), _length(problem, state)
    return Observability(inverse, condition, (), frozenset(), np.eye(problem.width), length)


def condition_number(problem: Problem, state: State, hessian: SparseHessian, factor: float) -> float | None:
    """Largest over smallest scaled sigma where every direction is seen; else None, and where motions leave one open."""
    scaled = hessian.rescale(column_scales(problem, state, _length(problem, state)))
    noise = max(factor, _SMALLEST_FACTOR)
    smallest, largest = scaled.extremes
    if smallest < noise / UNOBSERVABLE_SIGMA**2 or null_directions(problem, state).shape[1]:
        return None
    return float(np.sqrt(largest / smallest))


def _information_spectrum(problem: Problem, state: State, hessian: Array, least: float, scale: Array) -> Spectrum:
    """The information taken apart; what a prior says is no rounding, however much more the views say of the rest."""
    of = scaled_spectrum(_without_null_directions(problem, state, hessian), least, 1 / scale)
    scaled = of.vectors / of.scale[:, None]
    of_priors = np.sum(scaled * (prior_equations(problem, state)[0] @ scaled), axis=0)
    return replace(of, held=of.held | ((of.values > least) & (of_priors > _PRIOR_SHARE * of.values)))


def _without_null_directions(problem: Problem, state: State, hessian: Array) -> Array:
    """The information without what noise alone says of directions that the recorded poses leave open."""
    loose = null_directions(problem, state)
    if not loose.shape[1]:
        return hessian
    carried = linearise(without_priors(problem), state).hessian @ loose
    by_noise: Array = carried @ spectrum(loose.T @ carried).inverse @ carried.T
    return hessian - 0.5 * (by_noise + by_noise.T)


def is_informed(unknown: Unknown) -> bool:
    """Whether something is known of a transform beforehand; what holds a gauge alone is no knowledge."""
    return unknown.status == "prior" and unknown.sigma is not None and bool(np.all(np.isfinite(unknown.sigma)))


def without_priors(problem: Problem) -> Problem:
    """A copy without priors of transforms that are not fixed."""
    free = {n: replace(u, status="free") if is_informed(u) else u for n, u in problem.unknowns.items()}
    return replace(problem, unknowns=free)


def _required_columns(problem: Problem, name: str) -> int:
    """How many leading columns of an unknown must be seen: all of a transform, focal lengths and centre of a lens.

    Of a robot's kinematics none: each number is given or not alone.
    """
    return 6 if name in problem.unknowns else 4 if name in problem.lenses else 0


def column_scales(problem: Problem, state: State, length: float) -> Array:
    """The scale of each column: a length of the scene [m], 1 rad, an image width [px]."""
    scale = np.ones(problem.width)
    for name, where in problem.columns.items():
        if name in problem.unknowns:
            scale[where.start : where.start + 3] = length
        elif name in problem.lenses:
            camera = state.cameras[name]
            scale[where] = _DISTORTION_SCALE
            scale[where.start : where.start + 4] = float(camera.focal.mean())
    for model in problem.models.values():
        for name, kind in model.names.items():
            if name in problem.columns:
                scale[problem.columns[name]] = ROBOT_PARAMETERS[kind].scale
    return scale


def _length(problem: Problem, state: State) -> float:
    """How far targets are from the cameras that see them, of points in space how far arms reach: the median [m]."""
    few = [g.take(slice(None, None, -(-len(g) // _ENOUGH_VIEWS))) for g in problem.groups if len(g)]
    distances = [
        np.full(len(g), g.reach_m)
        if isinstance(g.measurement, PointMeasurement)
        else np.linalg.norm(state.camera_from_target(g, problem.stops).translation, axis=-1)
        for g in few
    ]
    return max(float(np.median(np.concatenate(distances))), 1e-3) if distances else 1.0
