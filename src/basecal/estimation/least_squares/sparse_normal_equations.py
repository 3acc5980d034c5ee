"""Sparse normal equations of a cell of many robots.

Each pair of camera and target couples at most two mounts, two bases and a lens. For a hundred robots, 1 % of the matrix
is non-zero, with little fill-in in its factors.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy  # its parts are loaded when they are first used

from basecal.estimation.least_squares.equal_pairs import PairBatch, group_pairs
from basecal.estimation.least_squares.normal_equations import NormalEquations, prior_residuals, retract
from basecal.estimation.problem.problem import Problem, State
from basecal.geometry import Array, IntArray
from basecal.numerics.batch import take
from basecal.numerics.levenberg_marquardt import Criteria, Optima, levenberg_marquardt
from basecal.numerics.sparse_hessian import SparseHessian

MANY_COLUMNS = 300
"""Number of unknowns from which the sparse solver is faster; see `benchmarks.robots`."""


def is_sparse(problem: Problem) -> bool:
    """Whether a problem has many unknowns, few of which affect each view, and views without shared errors."""
    if problem.width < MANY_COLUMNS or problem.models or problem.jitter_s or problem.tied is not None:
        return False
    return not np.any(problem.shared_stops >= 0)


@dataclass(frozen=True, eq=False)
class SparseNormalEquations:
    """Second-order expansion of a problem about a state, as a batch of one; see `NormalEquations`."""

    cost: Array
    gradient: Array
    hessian: SparseHessian
    eliminated_cost: Array
    pairs: tuple[NormalEquations, ...]
    states: tuple[State, ...]


@dataclass(frozen=True, eq=False)
class SparseBundle:
    """Adapter of a problem that implements `numerics.levenberg_marquardt.System`."""

    problem: Problem
    pairs: tuple[PairBatch, ...]
    weights: Sequence[Array] | None

    def linearise(self, state: State) -> SparseNormalEquations:
        """See `System`."""
        single = take(state, 0) if state.batch else state
        states = tuple(pairs.state(single) for pairs in self.pairs)
        models = tuple(pairs.linearise(own, self.weights) for pairs, own in zip(self.pairs, states, strict=True))
        empty = np.zeros(0, dtype=np.int64)
        gradient, blocks = np.zeros(self.problem.width), [(empty, empty, np.zeros(0))]
        cost = float(sum(model.cost.sum() for model in models))
        for pairs, model in zip(self.pairs, models, strict=True):
            np.add.at(gradient, pairs.columns, model.gradient)
            blocks.append(_scatter_blocks(pairs.columns, model.hessian))
        for residual, jacobian, column_slice in prior_residuals(self.problem, single):
            columns = np.arange(column_slice.start, column_slice.stop)
            cost += float(residual @ residual)
            gradient[columns] += jacobian.T @ residual
            blocks.append(_scatter_blocks(columns[None], (jacobian.T @ jacobian)[None]))
        rows, columns, values = (np.concatenate(part) for part in zip(*blocks, strict=True))
        matrix = scipy.sparse.csc_array(
            scipy.sparse.coo_array((values, (rows, columns)), shape=(self.problem.width, self.problem.width))
        )
        decrease = np.array([sum(float(model.eliminated_cost.sum()) for model in models)])
        return SparseNormalEquations(np.array([cost]), gradient[None], SparseHessian(matrix), decrease, models, states)

    def retract(self, state: State, model: SparseNormalEquations, step: Array) -> State:
        """See `System`."""
        without_stops = NormalEquations(model.cost, model.gradient, np.zeros(0), np.zeros(1), np.zeros(1), (), None)
        updated = retract(self.problem, state, without_stops, step)
        errors = state.stop_errors.copy()
        for pairs, equations, states in zip(self.pairs, model.pairs, model.states, strict=True):
            errors[0, pairs.stops] = pairs.stop_errors(states, equations, step[0])
        return State(updated.transforms, updated.cameras, errors, updated.robots)

    def take(self, rows: IntArray) -> SparseBundle:
        """See `System`."""
        return self


def sparse_adjust(
    problem: Problem, state: State, criteria: Criteria, weights: Sequence[Array] | None
) -> Optima[State, SparseNormalEquations]:
    """Minimise the cost from a state, as a batch of one; see `bundle_adjust`."""
    return levenberg_marquardt(sparse_bundle(problem, weights), state.repeat(problem, 1), criteria)


def sparse_bundle(problem: Problem, weights: Sequence[Array] | None = None) -> SparseBundle:
    """Return the adapter of a problem for which `is_sparse` holds."""
    return SparseBundle(problem, group_pairs(problem), weights)


def _scatter_blocks(columns: IntArray, blocks: Array) -> tuple[IntArray, IntArray, Array]:
    """Rows, columns and values of blocks (b, m, m) at columns (b, m)."""
    row = np.broadcast_to(columns[:, :, None], blocks.shape)
    column = np.broadcast_to(columns[:, None, :], blocks.shape)
    return row.ravel(), column.ravel(), blocks.ravel()
