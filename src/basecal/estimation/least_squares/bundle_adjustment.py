"""Bundle adjustment: the maximum-likelihood state near a start, for one state or a batch of states."""

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
    Criteria,
    Optima,
    levenberg_marquardt,
)
from basecal.numerics.sparse_hessian import SparseHessian

ROUGH_SIGMAS = 1e-2  # [sigma] convergence tolerance if more rounds follow; assumed


@dataclass(frozen=True, eq=False)
class Optimum:
    """Result of an iteration.

    Attributes:
        state: The final state.
        cost: Cost of the final state.
        converged: Whether the state is an optimum.
        iterations: Number of attempted steps.
        normal_source: Normal equations, or a function that computes them; see `normal`.
        sparse: Hessian before the last step, for many unknowns; else None.
    """

    state: State
    cost: float
    converged: bool
    iterations: int
    normal_source: NormalEquations | Callable[[], NormalEquations]
    sparse: SparseHessian | None = None

    @cached_property
    def normal(self) -> NormalEquations:
        """Normal equations before the last step, with the final cost; at the final state for many unknowns."""
        return self.normal_source() if callable(self.normal_source) else self.normal_source


@dataclass(frozen=True, eq=False)
class _Bundle:
    """Adapter of a problem that implements `System` for Levenberg-Marquardt."""

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
    """Results of a batch of iterations: (b,) of each field of `Optimum`, but only the Hessian of `normal`."""

    state: State
    cost: Array
    hessian: Array
    converged: BoolArray
    iterations: IntArray

    @property
    def best_state(self) -> State:
        """State of the lowest cost."""
        return take(self.state, int(np.argmin(np.nan_to_num(self.cost, nan=np.inf))))


def bundle_adjust(
    problem: Problem,
    state: State,
    dof: float,
    iterations: int = MOST_STEPS,
    weights: Sequence[Array] | None = None,
    tolerance: float = CONVERGED_SIGMAS,
) -> Optimum:
    """Minimise the cost from a start; see `numerics.levenberg_marquardt`.

    Args:
        problem: The problem.
        state: The start.
        dof: Residuals minus unknowns, which scales the sigmas.
        iterations: Maximum number of steps.
        weights: Weights of views, (n,) by group; all 1 if None.
        tolerance: Largest distance to the optimum at convergence, in sigmas of the unknowns.
    """
    criteria = Criteria(iterations, dof, tolerance, _least_damping(problem))
    if not is_sparse(problem):
        single = take(_optimise(problem, state.repeat(problem, 1), weights, criteria), 0)
        normal = replace(single.linearisation, cost=single.cost)
        return Optimum(single.state, float(single.cost), bool(single.converged), int(single.iterations), normal)
    optima = sparse_adjust(problem, state, criteria, weights)
    end, cost = take(optima.state, 0), float(optima.cost[0])

    def dense_equations() -> NormalEquations:
        """Dense normal equations, computed on request, since they take long."""
        return replace(linearise(problem, end, weights), cost=np.array(cost))

    return Optimum(
        end, cost, bool(optima.converged[0]), int(optima.iterations[0]), dense_equations, optima.linearisation.hessian
    )


def _least_damping(problem: Problem) -> float:
    """Minimum damping: smaller if a robot's parameters have priors, which may be the only information on them."""
    sigmas = [sigma for model in problem.models.values() for sigma in model.sigmas.values()]
    return PRIOR_DAMPING if any(sigma is not None for sigma in sigmas) else FIRST_DAMPING


def bundle_adjust_batch(
    problem: Problem,
    states: State,
    dof: float | Array,
    iterations: int = MOST_STEPS,
    weights: Sequence[Array] | None = None,
    tolerance: float = CONVERGED_SIGMAS,
) -> OptimumBatch:
    """Minimise the cost from each state of a batch (b,), independently.

    Args:
        problem: The problem, whose views may differ between entries of the batch; see `ViewGroup`.
        states: The starts; see `batch_states`.
        dof: Residuals minus unknowns, a number or (b,).
        iterations: Maximum number of steps.
        weights: Weights of views, (n,) or (b, n) by group; all 1 if None.
        tolerance: Largest distance to the optimum at convergence, in sigmas of the unknowns.
    """
    optima = _optimise(problem, states, weights, Criteria(iterations, dof, tolerance, _least_damping(problem)))
    return OptimumBatch(optima.state, optima.cost, optima.linearisation.hessian, optima.converged, optima.iterations)


def batch_states(problem: Problem, states: Sequence[State]) -> State:
    """Stack several states of one problem into a batch."""
    return concatenate([state.repeat(problem, 1) for state in states])


def _optimise(
    problem: Problem, states: State, weights: Sequence[Array] | None, criteria: Criteria
) -> Optima[State, NormalEquations]:
    return levenberg_marquardt(_Bundle(problem, weights), states, criteria)
