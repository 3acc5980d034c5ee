"""GTSAM with custom factors: one for everything, or one a view."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import gtsam
import numpy as np

from basecal.estimation.problem.problem import Problem, State
from basecal.geometry import SE3, Array
from benchmarks.solve.outcome import Outcome
from benchmarks.solve.whole import Whole

TOLERANCE = 1e-6
_SWAP = [3, 4, 5, 0, 1, 2]


class _Factors:
    """A graph over the unknowns, whose factors share one vectorised evaluation."""

    def __init__(self, problem: Problem, start: State, per_view: bool) -> None:
        self.whole, self.start = Whole(problem, start), start
        self.keys = list(range(len(self.whole.names)))
        views = len(self.whole.group)
        rows = len(self.whole.evaluate(start)[0]) // views
        parts = [slice(rows * k, rows * (k + 1)) for k in range(views)] if per_view else [slice(0, rows * views)]
        self.graph = gtsam.NonlinearFactorGraph()
        self._key, self._blocks = b"", (np.zeros(0), [np.zeros((0, 6))])
        for part in parts:
            noise = gtsam.noiseModel.Unit.Create(part.stop - part.start)
            self.graph.add(gtsam.CustomFactor(noise, self.keys, self._error(part)))

    def _error(self, part: slice) -> Callable[[Any, gtsam.Values, list[Array] | None], Array]:
        def error(_: Any, values: gtsam.Values, jacobians: list[Array] | None) -> Array:
            residual, blocks = self._evaluate_once(values)
            if jacobians is not None:
                for k, block in enumerate(blocks):
                    jacobians[k] = block[part]
            return residual[part]

        return error

    def _evaluate_once(self, values: gtsam.Values) -> tuple[Array, list[Array]]:
        matrices = np.stack([values.atPose3(k).matrix() for k in self.keys])
        key = matrices.tobytes()
        if key != self._key:
            residual, jacobian = self.whole.evaluate(self.state(matrices))
            column_major = np.asfortranarray(jacobian)
            blocks = [column_major[:, [6 * k + i for i in _SWAP]] for k in self.keys]
            self._key, self._blocks = key, (residual, [np.asfortranarray(b) for b in blocks])
        return self._blocks

    def state(self, matrices: Array) -> State:
        """State with poses given as (n, 4, 4) matrices in the order of the keys."""
        names = self.whole.names
        transforms = {n: SE3(m[:3, :3].copy(), m[:3, 3].copy()) for n, m in zip(names, matrices, strict=True)}
        return replace(self.start, transforms={**self.start.transforms, **transforms})

    def values(self) -> gtsam.Values:
        """Values of the start."""
        values = gtsam.Values()
        for key, name in zip(self.keys, self.whole.names, strict=True):
            values.insert(key, gtsam.Pose3(self.start.transforms[name].matrix))
        return values

    def forget(self) -> None:
        """Forget evaluations of earlier runs."""
        self.whole.forget()
        self._key = b""


def _solver(problem: Problem, start: State, per_view: bool, damped: bool, qr: bool) -> Callable[[], Outcome]:
    factors = _Factors(problem, start, per_view)
    parameters = gtsam.LevenbergMarquardtParams() if damped else gtsam.GaussNewtonParams()
    parameters.setRelativeErrorTol(TOLERANCE)
    parameters.setAbsoluteErrorTol(0.0)
    parameters.setLinearSolverType("MULTIFRONTAL_QR" if qr else "MULTIFRONTAL_CHOLESKY")
    optimizer = gtsam.LevenbergMarquardtOptimizer if damped else gtsam.GaussNewtonOptimizer

    def work() -> Outcome:
        factors.forget()
        run = optimizer(factors.graph, factors.values(), parameters)
        end = run.optimize()
        joint = gtsam.Marginals(factors.graph, end).jointMarginalCovariance(factors.keys).fullMatrix()
        order = [6 * k + i for k in factors.keys for i in _SWAP]
        state = factors.state(np.stack([end.atPose3(k).matrix() for k in factors.keys]))
        return Outcome(2 * run.error(), state, joint[np.ix_(order, order)], factors.whole.calls)

    return work


def solvers(problem: Problem, start: State) -> dict[str, Callable[[], Outcome]]:
    """Solvers by name, which gives the optimiser and the division of residuals into factors."""
    return {
        "GTSAM Gauss-Newton, one factor": _solver(problem, start, per_view=False, damped=False, qr=False),
        "GTSAM Gauss-Newton, a factor a view": _solver(problem, start, per_view=True, damped=False, qr=False),
        "GTSAM Levenberg-Marquardt, one factor": _solver(problem, start, per_view=False, damped=True, qr=False),
        "GTSAM Levenberg-Marquardt, a factor a view": _solver(problem, start, per_view=True, damped=True, qr=False),
        "GTSAM Gauss-Newton, one factor, QR": _solver(problem, start, per_view=False, damped=False, qr=True),
    }
