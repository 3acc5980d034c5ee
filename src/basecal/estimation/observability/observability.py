"""Observability analysis: which directions of the unknowns the data determine.

The information is scaled to a length of the scene and to radians. A direction with a scaled sigma above 0.3 is
unobservable. A direction without any information has zero covariance.
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

# Scaled sigma [m, rad] above which linearisation does not hold: the error of a sine is 1.5 % at 0.3 rad; assumed.
UNOBSERVABLE_SIGMA = 0.3
_NO_INFORMATION_SIGMA = 30.0  # scaled sigma [m, rad] above which the information is only rounding
TOUCHED_SHARE = 1e-3
"""Share of a null direction in an unknown above which the unknown is unobservable; its square is far above rounding."""
_SMALLEST_FACTOR = 1e-4  # variance factor of exact data: at least a hundredth of a sigma; assumed
_DISTORTION_SCALE = 10.0  # scale of a distortion term, equivalent to a radian; assumed
_PRIOR_SHARE = 0.5  # share of an eigenvalue due to priors above which it is information: rounding has either sign
_ENOUGH_VIEWS = 40  # most views per group from which the length of the scene is computed; assumed


@dataclass(frozen=True, eq=False)
class Observability:
    """Observability of the unknowns.

    Attributes:
        inverse: (p, p) inverse of the information, zero in directions without information.
        condition: Largest over smallest scaled sigma; infinite if a direction has no information.
        null_space: Unobservable directions, separated by kind.
        unobservable: Names of the transforms and lenses with an unobservable direction.
        onto_informative: (p, p) projection of a step that removes directions without information.
        length_m: Length of the scene, the scale of translations: median distance of targets from cameras [m].
    """

    inverse: Array
    condition: float
    null_space: tuple[NullDirection, ...]
    unobservable: frozenset[str]
    onto_informative: Array
    length_m: float = 1.0


def analyse_observability(problem: Problem, state: State, hessian: Array, factor: float) -> Observability:
    """Analyse observability from an information matrix (p, p), whose inverse times `factor` is the covariance."""
    if not len(hessian):
        return Observability(np.zeros((0, 0)), 1.0, (), frozenset(), np.zeros((0, 0)))
    length = _length(problem, state)
    scale = column_scales(problem, state, length)
    noise = max(factor, _SMALLEST_FACTOR)
    decomposed = _information_spectrum(problem, state, hessian, noise / _NO_INFORMATION_SIGMA**2, scale)
    values, vectors, has_no_information = decomposed.values, decomposed.vectors, ~decomposed.is_informative
    inverse = decomposed.inverse
    onto_informative = decomposed.inverse_root @ decomposed.root.T
    lenses = [columns for name, columns in problem.columns.items() if name in problem.lenses]
    distortion = [k for columns in lenses for k in range(columns.start + 4, columns.stop)]
    is_distortion = np.linalg.norm(vectors[distortion], axis=0) ** 2 > 0.5
    null = has_no_information | ((values < noise / UNOBSERVABLE_SIGMA**2) & ~is_distortion)
    directions = separate_null_space(problem, state, vectors[:, null], scale) if np.any(null) else ()
    names = frozenset(
        name
        for name, columns in problem.columns.items()
        if np.abs(vectors[columns][:, has_no_information]).max(initial=0.0) > TOUCHED_SHARE
        or np.sqrt(noise * np.diag(inverse)[columns] / scale[columns] ** 2)[: _required_columns(problem, name)].max(
            initial=0.0
        )
        > UNOBSERVABLE_SIGMA
    )
    condition = float(np.sqrt(values[-1] / values[0])) if not np.any(has_no_information) else float("inf")
    return Observability(inverse, condition, directions, names, onto_informative, length)


def sparse_observability(problem: Problem, state: State, hessian: SparseHessian, factor: float) -> Observability | None:
    """Same as `analyse_observability` if every direction is observable; else None."""
    condition = condition_number(problem, state, hessian, factor)
    if condition is None:
        return None
    inverse, length = hessian.inverse_block(np.arange(problem.width)), _length(problem, state)
    return Observability(inverse, condition, (), frozenset(), np.eye(problem.width), length)


def condition_number(problem: Problem, state: State, hessian: SparseHessian, factor: float) -> float | None:
    """Largest over smallest scaled sigma; None if a direction is unobservable from the information or the motions."""
    scaled = hessian.rescale(column_scales(problem, state, _length(problem, state)))
    noise = max(factor, _SMALLEST_FACTOR)
    smallest, largest = scaled.extremes
    if smallest < noise / UNOBSERVABLE_SIGMA**2 or null_directions(problem, state).shape[1]:
        return None
    return float(np.sqrt(largest / smallest))


def _information_spectrum(problem: Problem, state: State, hessian: Array, least: float, scale: Array) -> Spectrum:
    """Scaled spectrum of the information; eigenvalues that are mainly due to priors are never treated as rounding."""
    decomposed = scaled_spectrum(_without_null_directions(problem, state, hessian), least, 1 / scale)
    scaled = decomposed.vectors / decomposed.scale[:, None]
    prior_values = np.sum(scaled * (prior_equations(problem, state)[0] @ scaled), axis=0)
    return replace(
        decomposed,
        is_informative=decomposed.is_informative
        | ((decomposed.values > least) & (prior_values > _PRIOR_SHARE * decomposed.values)),
    )


def _without_null_directions(problem: Problem, state: State, hessian: Array) -> Array:
    """Remove the information in directions that the recorded poses leave unobservable, which is due to noise alone."""
    null = null_directions(problem, state)
    if not null.shape[1]:
        return hessian
    products = linearise(without_priors(problem), state).hessian @ null
    noise_information: Array = products @ spectrum(null.T @ products).inverse @ products.T
    return hessian - 0.5 * (noise_information + noise_information.T)


def is_informed(unknown: Unknown) -> bool:
    """Whether a transform has a finite prior; an infinite sigma only fixes a gauge."""
    return unknown.status == "prior" and unknown.sigma is not None and bool(np.all(np.isfinite(unknown.sigma)))


def without_priors(problem: Problem) -> Problem:
    """Return a copy without priors of transforms; fixed transforms stay fixed."""
    free = {n: replace(u, status="free") if is_informed(u) else u for n, u in problem.unknowns.items()}
    return replace(problem, unknowns=free)


def _required_columns(problem: Problem, name: str) -> int:
    """Number of leading columns of an unknown that must be observable.

    These are all of a transform, and focal lengths and centre of a lens. Robot parameters have none, since each
    parameter is judged separately.
    """
    return 6 if name in problem.unknowns else 4 if name in problem.lenses else 0


def column_scales(problem: Problem, state: State, length: float) -> Array:
    """Scale of each column, (p,): length of the scene [m], 1 rad, focal length [px], 10 for a distortion term."""
    scale = np.ones(problem.width)
    for name, columns in problem.columns.items():
        if name in problem.unknowns:
            scale[columns.start : columns.start + 3] = length
        elif name in problem.lenses:
            camera = state.cameras[name]
            scale[columns] = _DISTORTION_SCALE
            scale[columns.start : columns.start + 4] = float(camera.focal.mean())
    for model in problem.models.values():
        for name, kind in model.names.items():
            if name in problem.columns:
                scale[problem.columns[name]] = ROBOT_PARAMETERS[kind].scale
    return scale


def _length(problem: Problem, state: State) -> float:
    """Median distance of targets from cameras [m]; for points measured in 3-D, the reach of the arms."""
    thinned = [g.take(slice(None, None, -(-len(g) // _ENOUGH_VIEWS))) for g in problem.groups if len(g)]
    distances = [
        np.full(len(g), g.reach_m)
        if isinstance(g.measurement, PointMeasurement)
        else np.linalg.norm(state.camera_from_target(g, problem.stops).translation, axis=-1)
        for g in thinned
    ]
    return max(float(np.median(np.concatenate(distances))), 1e-3) if distances else 1.0
