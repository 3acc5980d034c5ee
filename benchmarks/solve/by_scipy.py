"""SciPy's `least_squares` with our Jacobian."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from basecal.estimation.problem.problem import Problem, State
from benchmarks.solve.outcome import Outcome
from benchmarks.solve.task import move_start
from benchmarks.solve.whole import Whole, covariance

TOLERANCE = 1e-6


def _solver(problem: Problem, start: State, options: dict[str, Any]) -> Callable[[], Outcome]:
    whole = Whole(problem, start)

    def work() -> Outcome:
        whole.forget()
        result = least_squares(
            lambda x: whole.at_step(x)[0].copy(),  # MINPACK writes into both
            np.zeros(problem.width),
            jac=lambda x: whole.at_step(x)[1].copy(),
            ftol=TOLERANCE,
            xtol=1e-12,
            gtol=1e-12,
            **options,
        )
        end = move_start(start, whole.names, result.x)
        return Outcome(2 * float(result.cost), end, covariance(result.jac), whole.calls)

    return work


def solvers(problem: Problem, start: State) -> dict[str, Callable[[], Outcome]]:
    """Solvers by method."""
    options: dict[str, dict[str, Any]] = {
        "SciPy lm": {"method": "lm"},
        "SciPy trf, exact": {"method": "trf", "tr_solver": "exact"},
        "SciPy trf, lsmr": {"method": "trf", "tr_solver": "lsmr", "x_scale": "jac"},
        "SciPy dogbox, exact": {"method": "dogbox", "tr_solver": "exact"},
    }
    return {name: _solver(problem, start, each) for name, each in options.items()}
