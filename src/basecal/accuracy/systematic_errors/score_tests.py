"""Score tests at a solution: the significance of an additional unknown without solving for it.

Let g be the gradient and H the information of views, with the errors of single stops eliminated. D is the derivative of
the views with respect to the unknowns and to the random effects that stops share, in units of their sigmas. I is the
prior information of these columns, and E the derivative with respect to the error. U = E'g - E'HD (D'HD + I)^+ D'g has
the covariance P = E'HE - E'HD (D'HD + I)^+ D'HE. U'P^-1 U is chi-square if there is no such error, as the covariance
includes all random effects of the null model. Source: Rao 1948; docs/mathematics.md (11.1).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.special import betainc, betaln

from basecal.accuracy.model_comparison.nested_models import LEAST_CHANCE, log_chance
from basecal.effects.faces.candidates import Candidates, Moves
from basecal.estimation.least_squares.normal_equations import (
    LinearisedViews,
    linearise,
    prior_equations,
    prior_residuals,
    sum_views,
)
from basecal.estimation.least_squares.schur_complement import SchurComplement
from basecal.estimation.problem.problem import Problem, State
from basecal.geometry import Array, IntArray
from basecal.numerics.group_sums import GroupSums
from basecal.numerics.spectral import scaled_spectrum, spectrum

HIDDEN_SHARE = 1e-4
"""Share of an error's information left by the unknowns, below which the error is confounded with the unknowns."""


@dataclass(frozen=True, eq=False)
class Score:
    """The score tests of b errors of one kind, each of q sizes.

    Attributes:
        gradient: (b, q) gradient with respect to the sizes, the unknowns projected out.
        information: (b, q, q) information about the sizes, the unknowns projected out.
        statistic: (b,) test statistic, chi-square distributed without the error.
        freedoms: (b,) degrees of freedom of the statistic.
        size: (b, q) most likely sizes to first order.
    """

    gradient: Array
    information: Array
    statistic: Array
    freedoms: IntArray
    size: Array

    @property
    def log_chance(self) -> Array:
        """(b,) log p-value of the statistic."""
        pairs = zip(self.statistic, self.freedoms, strict=True)
        return np.array([log_chance(float(value), int(freedoms)) for value, freedoms in pairs])


def log_chance_of_gain(gain: float, freedoms: int, residual_freedoms: float) -> float:
    """Log p-value of a decrease of minus twice the log likelihood by additional unknowns.

    The noise is estimated with and without these unknowns. The gain therefore determines the ratio of the sums of
    squares, which has an F distribution if the unknowns have no effect. Source: docs/mathematics.md (11.2).

    Args:
        gain: Decrease of minus twice the log likelihood.
        freedoms: Number of additional unknowns.
        residual_freedoms: Degrees of freedom of the residuals without the additional unknowns.
    """
    left = 0.5 * (residual_freedoms - freedoms)
    if freedoms < 1 or left <= 0:
        return 0.0
    log_ratio = -max(gain, 0.0) / residual_freedoms
    chance = float(betainc(left, 0.5 * freedoms, np.exp(log_ratio)))
    if chance > LEAST_CHANCE:
        return float(np.log(chance))
    return float(left * log_ratio - np.log(left) - betaln(left, 0.5 * freedoms))


@dataclass(frozen=True, eq=False)
class Linearised:
    """A problem to second order about a state: weighted views, and their sums with stops eliminated.

    The columns are the p unknowns, then the random effects that stops share, in units of their sigmas.

    Attributes:
        problem: The problem.
        state: The state of the linearisation.
        views: Linearised views of each group.
        gradient: (c,) gradient with respect to the columns.
        hessian: (c, c) Hessian of the columns.
        system: The eliminated stops that views share; None without any.
    """

    problem: Problem
    state: State
    views: tuple[LinearisedViews, ...]
    gradient: Array
    hessian: Array
    system: SchurComplement | None

    @cached_property
    def residual_freedoms(self) -> float:
        """Degrees of freedom of the views' residuals: equations less unknowns, corrected for the effect of priors."""
        priors = ((jacobian, where) for _, jacobian, where in prior_residuals(self.problem, self.state))
        held = sum(float(np.sum((j @ self.inverse[where, where]) * j)) for j, where in priors)
        return self.problem.equation_count - self.problem.width + held

    @cached_property
    def inverse(self) -> Array:
        """(c, c) inverse of the Hessian, zero along directions without information."""
        return spectrum(self.hessian).inverse

    @cached_property
    def step(self) -> Array:
        """(c,) product of the inverse Hessian and the gradient."""
        return self.inverse @ self.gradient


class Sums(NamedTuple):
    """Sums over views for b candidates of q sizes.

    Attributes:
        gradient: (b, q) gradient with respect to the sizes.
        across: (b, q, c) information between sizes and columns.
        information: (b, q, q) information between sizes.
    """

    gradient: Array
    across: Array
    information: Array


def linearise_views(problem: Problem, state: State) -> Linearised:
    """Linearise a problem about a state."""
    normal = linearise(problem, state)
    return Linearised(problem, state, normal.views, normal.gradient, normal.hessian, normal.system)


def with_random_effects(model: Linearised, moves: Moves, values: Array | float = 0.0) -> Linearised:
    """Return a copy of a model with random effects as additional columns.

    Args:
        model: The model.
        moves: For each group, (n, 6, r) right tangents of `camera_from_target` for one sigma of each effect.
        values: (r,) values of the effects at the state, in sigmas.
    """
    count = next((m.shape[-1] for m in moves if m is not None), 0)
    if not count:
        return model
    more = len(model.gradient) + np.arange(count)
    views = (of if m is None else _with_columns(of, m, more) for of, m in zip(model.views, moves, strict=True))
    wider = _sum_views(model.problem, model.state, tuple(views), len(model.gradient) + count)
    return replace(wider, gradient=wider.gradient + np.append(np.zeros(len(model.gradient)), values * np.ones(count)))


def _with_columns(views: LinearisedViews, moves: Array, columns: IntArray) -> LinearisedViews:
    """Add columns to linearised views; the added columns have no effect on the lens."""
    *shape, rows, _ = views.by_unknowns.shape
    padded = np.zeros((*shape, rows, len(columns)))
    padded[..., :6, :] = moves
    by_columns = np.concatenate([views.by_unknowns, padded], axis=-1)
    return replace(views, by_unknowns=by_columns, columns=np.append(views.columns, columns))


def weigh_views(model: Linearised, weights: Sequence[Array]) -> Linearised:
    """Return a copy of a model with its views multiplied by `weights`, (n,) for each group."""
    views = tuple(each.weigh(weight) for each, weight in zip(model.views, weights, strict=True))
    return _sum_views(model.problem, model.state, views, len(model.gradient))


def _sum_views(problem: Problem, state: State, views: tuple[LinearisedViews, ...], width: int) -> Linearised:
    """Sum views over `width` columns; columns after the unknowns are random effects of unit variance."""
    gradient, hessian, unknowns = np.zeros(width), np.eye(width), slice(problem.width)
    hessian[unknowns, unknowns], gradient[unknowns], _ = prior_equations(problem, state)
    _, hessian, gradient, system = sum_views(problem, state, views, hessian, gradient)
    return Linearised(problem, state, views, gradient, hessian, system)


def score(model: Linearised, candidates: Candidates, largest: float = np.inf) -> Score:
    """Compute the score tests of errors of one kind.

    Args:
        model: The null model.
        candidates: The errors.
        largest: Largest expected sigma of the sizes; infinite without a prior.
    """
    return score_from_sums(model, view_sums(model, candidates), largest)


def score_from_sums(model: Linearised, sums: Sums, largest: float = np.inf) -> Score:
    """Compute the score tests as `score` does, from given sums over views."""
    gradient, across, information = sums
    tied = np.flatnonzero(across.any((0, 1)))  # of a hundred robots, an error concerns the columns of a few
    across = across[..., tied]
    gradient = gradient - across @ model.step[tied]
    left = information - across @ model.inverse[np.ix_(tied, tied)] @ across.mT
    left = 0.5 * (left + left.mT)
    size = np.sqrt(np.maximum(np.diagonal(information, axis1=1, axis2=2), 0.0))
    seen = scaled_spectrum(left, HIDDEN_SHARE, np.where(size > 0, size, 1.0))
    sizes = -(seen.inverse_with_ridge(largest**-2) @ gradient[..., None])[..., 0]
    return Score(gradient, left, -np.vecdot(gradient, sizes), seen.rank, sizes)


def view_sums(model: Linearised, candidates: Candidates) -> Sums:
    """Compute the sums over views of candidates, with stops eliminated."""
    b, q = len(candidates.about), candidates.sizes
    gradient, information = np.zeros((b, q)), np.zeros((b, q, q))
    across = np.zeros((b, q, len(model.gradient)))
    moved = [
        (views, moves)
        for views, moves in zip(model.views, candidates.moves, strict=True)
        if moves is not None and moves.any()  # of a hundred robots, an error moves the views of a few
    ]
    stops = np.unique(np.concatenate([np.zeros(0, np.int64), *(part.stop for of, _ in moved for part in of.shared)]))
    tied = np.zeros((len(stops), 6, b, q))
    for views, moves in moved:
        own = views.information[:, :6, :6]
        carried = own[:, None] @ moves
        gradient += np.tensordot(views.gradient[:, :6], moves, ((0, 1), (0, 2)))
        rows = len(moves) * moves.shape[2]
        by_candidate = np.moveaxis(moves, 1, 0).reshape(b, rows, q)
        information += by_candidate.mT @ np.moveaxis(carried, 1, 0).reshape(b, rows, q)
        by_unknowns = (views.information @ views.by_unknowns)[:, :6]
        across[..., views.columns] += np.tensordot(moves, by_unknowns, ((0, 2), (0, 1)))
        for part in views.shared:
            pull = part.by_error.mT @ views.information[part.view][:, :, :6]
            rows = GroupSums(np.searchsorted(stops, part.stop), len(stops))
            tied += rows.sum(np.moveaxis(pull[:, None] @ moves[part.view], 1, 2))
    if model.system is not None:
        flat = tied.reshape(-1, b * q)
        solution = model.system.stop_solutions(stops)
        gradient -= (solution[:, -1] @ flat).reshape(b, q)
        across -= (flat.T @ solution[:, :-1]).reshape(b, q, -1)
        of_stops = np.moveaxis(flat.reshape(-1, b, q), 0, 1)
        information -= of_stops.mT @ np.moveaxis(model.system.solve_stops(stops, flat).reshape(-1, b, q), 0, 1)
    return Sums(gradient, across, information)
