"""The maximum-likelihood state downhill of a start: one state, or a batch of them at once."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from basecal.estimation.least_squares.normal_equations import NormalEquations, linearise, retract
from basecal.estimation.least_squares.sparse_normal_equations import is_sparse, sparse_adjust
from basecal.estimation.problem.problem import Problem, State
from basecal.estimation.settings import MOST_STEPS
from basecal.geometry import Array, BoolArray, IntArray
from basecal.numerics.batch import concatenate, take
from basecal.numerics.levenberg_marquardt import (
    CONVERGED_SIGMAS,
    FIRST_DAMPING,
    PRIOR_DAMPING,
    Optima,
    Stop,
    levenberg_marquardt,
)
from basecal.numerics.sparse_hessian import SparseHessian

ROUGH_SIGMAS = 1e-2  # what may be left to go where more rounds follow: a hundredth of a sigma; assumed


@dataclass(frozen=True, eq=False)
class Optimum:
    """Where an iteration ended.

    Attributes:
        state: The state.
        cost: There, after the last step.
        converged: Whether it is an optimum.
        iterations: Steps tried.
        found: See `normal`.
        sparse: The hessian before the last step, of many unknowns; else None.
    """

    state: State
    cost: float
    converged: bool
    iterations: int
    found: NormalEquations | Callable[[], NormalEquations]
    sparse: SparseHessian | None = None

    @cached_property
    def normal(self) -> NormalEquations:
        """The problem as it stood before the last step, but for its cost; of many unknowns as it stands at the end."""
        return self.found() if callable(self.found) else self.found


@dataclass(frozen=True, eq=False)
class _Bundle:
    """A problem as Levenberg-Marquardt knows it; see `System`."""

    problem: Problem
    weights: Sequence[Array] | None

    def linearise(self, state: State) -> NormalEquations:
        """See `System`."""
        return linearise(self.problem, state, self.weights)

    def retract(self, state: State, model: NormalEquations, step: Array) -> State:
        """See `System`."""
        return retract(self.problem, state, model, step)

    def take(self, rows: IntArray) -> _Bundle:
        """See `System`."""
        weights = None if self.weights is None else [w[rows] if w.ndim > 1 else w for w in self.weights]
        return _Bundle(self.problem.take_batch(rows), weights)


@dataclass(frozen=True, eq=False)
class OptimumBatch:
    """Where the iterations of a batch ended: (b,) of each field of `Optimum`, of the problem the hessian alone."""

    state: State
    cost: Array
    hessian: Array
    converged: BoolArray
    iterations: IntArray


def bundle_adjust(
    problem: Problem,
    state: State,
    dof: float,
    iterations: int = MOST_STEPS,
    weights: Sequence[Array] | None = None,
    sigmas: float = CONVERGED_SIGMAS,
) -> Optimum:
    """The optimum downhill of `state`; see `numerics.levenberg_marquardt`.

    Args:
        problem: The problem.
        state: Where to start.
        dof: Residuals less unknowns, which scales the sigmas.
        iterations: At most.
        weights: What each view counts, (n,) by group; 1 where None.
        sigmas: What may be left to go.
    """
    stop = Stop(iterations, dof, sigmas, _least_damping(problem))
    if not is_sparse(problem):
        only = take(_optimise(problem, state.spread(problem, 1), weights, stop), 0)
        normal = replace(only.about, cost=only.cost)
        return Optimum(only.state, float(only.cost), bool(only.converged), int(only.iterations), normal)
    optima = sparse_adjust(problem, state, stop, weights)
    end, cost = take(optima.state, 0), float(optima.cost[0])

    def dense_equations() -> NormalEquations:
        """Dense normal equations, computed on request, since they take long."""
        return replace(linearise(problem, end, weights), cost=np.array(cost))

    return Optimum(
        end, cost, bool(optima.converged[0]), int(optima.iterations[0]), dense_equations, optima.about.hessian
    )


def _least_damping(problem: Problem) -> float:
    """Less where a robot's parameters have priors, which may be all that is known of them."""
    sigmas = [sigma for model in problem.models.values() for sigma in model.sigmas.values()]
    return PRIOR_DAMPING if any(sigma is not None for sigma in sigmas) else FIRST_DAMPING


def bundle_adjust_batch(
    problem: Problem,
    states: State,
    dof: float | Array,
    iterations: int = MOST_STEPS,
    weights: Sequence[Array] | None = None,
) -> OptimumBatch:
    """The optima downhill of a batch of states (b,), each alone.

    Args:
        problem: The problem, whose views may be others for each entry of the batch; see `ViewGroup`.
        states: Where to start; see `batch_states`.
        dof: Residuals less unknowns, a number or (b,).
        iterations: At most.
        weights: What each view counts, (n,) or (b, n) by group; 1 where None.
    """
    optima = _optimise(problem, states, weights, Stop(iterations, dof, damping=_least_damping(problem)))
    return OptimumBatch(optima.state, optima.cost, optima.about.hessian, optima.converged, optima.iterations)


def batch_states(problem: Problem, states: Sequence[State]) -> State:
    """Several states of one problem as a batch."""
    return concatenate([state.spread(problem, 1) for state in states])


def _optimise(
    problem: Problem, states: State, weights: Sequence[Array] | None, stop: Stop
) -> Optima[State, NormalEquations]:
    return levenberg_marquardt(_Bundle(problem, weights), states, stop)
