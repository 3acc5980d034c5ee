"""Ceres, by pyceres, with one analytic cost."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pyceres

from basecal.estimation.problem.problem import Problem, State
from basecal.geometry import Array
from benchmarks.solve.outcome import Outcome
from benchmarks.solve.task import move_start
from benchmarks.solve.whole import Whole, covariance

TOLERANCE = 1e-6


class _Cost(pyceres.CostFunction):
    """All residuals as a function of one block of 18 tangents about the start."""

    def __init__(self, whole: Whole, width: int, count: int) -> None:
        super().__init__()
        self.whole = whole
        self.set_num_residuals(count)
        self.set_parameter_block_sizes([width])

    def Evaluate(self, parameters: list[Array], residuals: Array, jacobians: list[Array | None] | None) -> bool:
        """Evaluate residuals and, if requested, their Jacobian, as Ceres defines it."""
        residual, jacobian = self.whole.at_step(np.array(parameters[0]))
        residuals[:] = residual
        first = None if jacobians is None else jacobians[0]
        if first is not None:
            first[:] = jacobian.reshape(-1)
        return True


def _solver(
    problem: Problem, start: State, linear: pyceres.LinearSolverType, own_covariance: bool
) -> Callable[[], Outcome]:
    whole = Whole(problem, start)
    count = len(whole.evaluate(start)[0])
    options = pyceres.SolverOptions()
    options.linear_solver_type = linear
    options.num_threads = 1
    options.function_tolerance = TOLERANCE
    options.parameter_tolerance = options.gradient_tolerance = 1e-12
    options.logging_type = pyceres.LoggingType.SILENT

    def work() -> Outcome:
        whole.forget()
        step = np.zeros(problem.width)
        task = pyceres.Problem()
        task.add_residual_block(_Cost(whole, problem.width, count), None, [step])
        summary = pyceres.SolverSummary()
        pyceres.solve(options, task, summary)
        spread = _covariance_of(task, step) if own_covariance else covariance(whole.at_step(step)[1])
        return Outcome(2 * summary.final_cost, move_start(start, whole.names, step), spread, whole.calls)

    return work


def _covariance_of(task: pyceres.Problem, step: Array) -> Array:
    options = pyceres.CovarianceOptions()
    options.num_threads = 1
    covariance_solver = pyceres.Covariance(options)
    assert covariance_solver.compute([(step, step)], task)
    block: Array = covariance_solver.get_covariance_block(step, step)
    return block


def solvers(problem: Problem, start: State) -> dict[str, Callable[[], Outcome]]:
    """Solvers by name, which gives the linear solver and how the information is inverted."""
    kinds = pyceres.LinearSolverType
    return {
        "Ceres dense normal Cholesky": _solver(problem, start, kinds.DENSE_NORMAL_CHOLESKY, True),
        "Ceres dense normal Cholesky, covariance by NumPy": _solver(problem, start, kinds.DENSE_NORMAL_CHOLESKY, False),
        "Ceres dense QR, covariance by NumPy": _solver(problem, start, kinds.DENSE_QR, False),
    }
