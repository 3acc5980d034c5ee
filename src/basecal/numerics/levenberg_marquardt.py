"""Levenberg-Marquardt for a batch of least-squares problems of one structure.

Each problem has its own damping and its own convergence. The cost of a problem never increases.
Source: Marquardt 1963, with the damping of Nielsen 1999. Near an optimum, the second-order curvature of the residuals
is included by structured secants.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Generic, NamedTuple, Protocol, TypeVar

import numpy as np

from basecal.geometry import Array, BoolArray, IntArray
from basecal.numerics.batch import choose_entries, concatenate, take
from basecal.numerics.sparse_hessian import SparseHessian
from basecal.numerics.structured_secant import usable_curvature, with_secant

CONVERGED_SIGMAS = 1e-5  # distance to the optimum at convergence, in sigmas of the unknowns: negligible in any result
_SMALLEST_STEP = 1e-13  # [m, rad]: rounding of poses at a distance of a metre
# Predicted decrease, relative to that of the previous step, above which steps no longer shrink: they are rounding.
_ROUNDING_RATIO = 0.5
FIRST_DAMPING = 1e-9  # relative to the scaled diagonal: Gauss-Newton, but regular if a direction is unobservable
PRIOR_DAMPING = (
    1e-13  # for problems that priors make regular: more would dominate a prior of degrees beside micrometres
)
# Predicted decrease relative to the cost, below which the secant of a step describes the curvature at the optimum. It
# is needed for starts whose residuals do not determine sigmas.
_NEAR_SHARE = 1e-3
_GAUSS_NEWTON_DAMPING = 1e-3  # below this a step is a Gauss-Newton step to three digits
_LARGEST_DAMPING = 1e12  # above this steps are rounding
_LARGEST_GAIN = 10.0  # clips the ratio of gain to prediction, whose cube sets the damping
_COST_ROUNDING = 1e-12  # relative rounding of a cost

S = TypeVar("S")


class Linearised(Protocol):
    """Quadratic models of problems: cost (b,), and half its gradient (b, p) and Hessian (b, p, p).

    A single problem with many unknowns has a sparse Hessian.
    """

    @property
    def cost(self) -> Array:
        """Cost, (b,); infinite or NaN for invalid states."""

    @property
    def gradient(self) -> Array:
        """Half the gradient of the cost, (b, p)."""

    @property
    def hessian(self) -> Array | SparseHessian:
        """Half the Hessian of the cost, (b, p, p), or (p, p) if it is sparse."""

    @property
    def eliminated_cost(self) -> Array | float:
        """Decrease of the cost, (b,), if only the eliminated unknowns are optimised with the next step."""


class Quadratic(NamedTuple):
    """Quadratic models of problems as plain arrays; see `Linearised`."""

    cost: Array
    gradient: Array
    hessian: Array
    eliminated_cost: Array | float = 0.0


L = TypeVar("L", bound=Linearised)


class System(Protocol[S, L]):
    """Interface of a batch of problems of one structure, as used by Levenberg-Marquardt."""

    def linearise(self, state: S) -> L:
        """Linearise the problems at their states."""

    def retract(self, state: S, model: L, step: Array) -> S:
        """Return the states after steps (b, p)."""

    def take(self, rows: IntArray) -> System[S, L]:
        """Select problems of the batch."""


@dataclass(frozen=True)
class Criteria:
    """Convergence criteria of a problem.

    Attributes:
        iterations: Most steps.
        dof: Degrees of freedom, residuals minus unknowns, a number or (b,); cost / dof scales the squared sigmas.
        tolerance: Largest distance to the optimum in sigmas; if `dof` is 1, its square is relative to the cost.
        damping: Least damping, relative to the scaled diagonal.
    """

    iterations: int = 100
    dof: float | Array = 1.0
    tolerance: float = CONVERGED_SIGMAS
    damping: float = FIRST_DAMPING


@dataclass(frozen=True, eq=False)
class Optima(Generic[S, L]):
    """Final states of a batch of problems.

    Attributes:
        state: Final states.
        cost: (b,) costs after the last step.
        linearisation: Linearised problems before their last step.
        converged: (b,) whether each state is an optimum.
        iterations: (b,) number of steps tried.
    """

    state: S
    cost: Array
    linearisation: L
    converged: BoolArray
    iterations: IntArray


@dataclass(frozen=True, eq=False)
class _Active(Generic[S, L]):
    """Problems that have not ended yet; `row` is their index in the original batch."""

    row: IntArray
    state: S
    cost: Array
    linearisation: L
    dof: Array
    damping: Array
    growth: Array
    expected: Array  # predicted decrease of the cost for the last accepted step; 0 before the first
    residual_curvature: Array | None  # (b, p, p) second-order curvature of the residuals; None if the Hessian is sparse

    def end(self, state: S, cost: Array, has_converged: bool, iterations: int) -> tuple[IntArray, Optima[S, L]]:
        """Make the optima of all these problems, which ended in the same way."""
        count = len(self.row)
        converged, steps = np.full(count, has_converged), np.full(count, iterations, dtype=np.int64)
        return self.row, Optima(state, cost, self.linearisation, converged, steps)


@np.errstate(all="ignore")  # steps to states that are not finite are rejected
def levenberg_marquardt(system: System[S, L], state: S, criteria: Criteria) -> Optima[S, L]:
    """Minimise a batch of problems from initial states.

    A problem has converged in two cases. In the first, the remaining error after a step is a small share of the sigmas
    of the unknowns. This error is estimated from the rate at which steps shrink. In the second, a step is rounding. It
    is below 1e-13 [m, rad], or its predicted decrease is below the rounding of the cost and no longer shrinks.

    Args:
        system: The problems.
        state: Initial states.
        criteria: Convergence criteria.
    """
    linearisation = system.linearise(state)
    count = len(linearisation.cost)
    active = _Active(
        np.arange(count),
        state,
        linearisation.cost,
        linearisation,
        np.broadcast_to(np.maximum(np.asarray(criteria.dof, dtype=np.float64), 1.0), (count,)),
        np.full(count, criteria.damping),
        np.full(count, 2.0),
        np.zeros(count),
        None if isinstance(linearisation.hessian, SparseHessian) else np.zeros_like(linearisation.hessian),
    )
    ends: list[tuple[IntArray, Optima[S, L]]] = []
    for k in range(criteria.iterations):
        remaining = _iterate(active, system, ends, k + 1, criteria)
        if remaining is None:
            break
        active, system = remaining
    else:
        ends.append(active.end(active.state, active.cost, False, criteria.iterations))
    return join_ends(ends)


def join_ends(ends: Sequence[tuple[IntArray, Optima[S, L]]]) -> Optima[S, L]:
    """Join groups of optima to one batch, sorted by row."""
    row, optima = concatenate(ends)
    return optima if np.all(row[1:] > row[:-1]) else take(optima, np.argsort(row))


def _iterate(
    active: _Active[S, L],
    system: System[S, L],
    ends: list[tuple[IntArray, Optima[S, L]]],
    number: int,
    criteria: Criteria,
) -> tuple[_Active[S, L], System[S, L]] | None:
    """Try one step of every problem; append ended problems to `ends`, and return the others, or None if all ended."""
    step, expected = _next_step(active)
    settled = _has_converged(active, step, expected, criteria)
    candidate = system.retract(active.state, active.linearisation, step)
    is_done = settled & _is_gauss_newton(active, criteria)
    if is_done.any():
        cost = np.maximum(active.cost[is_done] - expected[is_done], 0.0)
        ends.append(take(active, is_done).end(take(candidate, is_done), cost, True, number))
        if is_done.all():
            return None
        kept = np.flatnonzero(~is_done)
        active, candidate, system = take(active, kept), take(candidate, kept), system.take(kept)
        step, expected, settled = step[kept], expected[kept], settled[kept]
    linearisation, cost = _linearise(system, candidate, active.linearisation)
    better = cost <= active.cost * (1 + _COST_ROUNDING)
    curvature = _updated_curvature(active, linearisation, step, better & _is_near(active, expected))
    expected = np.maximum(expected, 1e-300)
    active = _accept_step(active, candidate, linearisation, cost, better, expected, curvature, criteria.damping)
    is_stuck, is_lost = ~better & settled, ~better & (active.damping > _LARGEST_DAMPING)
    for ended, converged in ((is_stuck, True), (is_lost & ~is_stuck, False)):
        if ended.any():
            finished = take(active, ended)
            ends.append(finished.end(finished.state, finished.cost, converged, number))
    going = np.flatnonzero(~(is_stuck | is_lost))
    if len(going) == len(is_stuck):
        return active, system
    return (take(active, going), system.take(going)) if len(going) else None


def _is_gauss_newton(active: _Active[S, L], criteria: Criteria) -> BoolArray:
    """Whether a step is a Gauss-Newton step, or the Gauss-Newton step without damping would be insignificant, (b,)."""
    undamped = active.damping <= _GAUSS_NEWTON_DAMPING
    if undamped.all():
        return undamped
    step = _damped_step(active.linearisation, np.full(len(undamped), criteria.damping))
    decrement = _quadratic(active.linearisation, step)
    is_gauss_newton: BoolArray = undamped | (decrement <= criteria.tolerance**2 * _scale(active))
    return is_gauss_newton


def _scale(active: _Active[S, L]) -> Array:
    """Variance factor of the residuals, cost / dof, (b,)."""
    return np.where(np.isfinite(active.cost), active.cost / active.dof, 1.0)


def _has_converged(active: _Active[S, L], step: Array, expected_decrease: Array, criteria: Criteria) -> BoolArray:
    """Whether the remaining error after a step is insignificant relative to the sigmas, or rounding, (b,)."""
    limit = criteria.tolerance**2 * _scale(active)
    is_shrinking = (active.expected > 0) & (active.damping <= _GAUSS_NEWTON_DAMPING)
    previous = np.where(is_shrinking, active.expected, 1.0)
    rate = np.where(is_shrinking, np.minimum(previous, expected_decrease) / previous, 1.0)
    # A rejected step is rounding, and so is one whose predicted decrease no longer shrinks.
    is_rounding = (active.damping > _GAUSS_NEWTON_DAMPING) | (
        (active.expected > 0) & (expected_decrease > _ROUNDING_RATIO * active.expected)
    )
    is_tiny = (np.abs(step).max(axis=1, initial=0.0) < _SMALLEST_STEP) & (
        (active.linearisation.eliminated_cost <= limit) | is_rounding
    )
    cost_rounding = _COST_ROUNDING * np.where(np.isfinite(active.cost), active.cost, 0.0)
    is_invisible = is_rounding & (expected_decrease <= cost_rounding)
    settled: BoolArray = (expected_decrease * rate <= limit) | is_tiny | is_invisible
    return settled


def _accept_step(
    active: _Active[S, L],
    candidate: S,
    linearisation: L,
    cost: Array,
    is_better: BoolArray,
    expected_decrease: Array,
    residual_curvature: Array | None,
    least_damping: float,
) -> _Active[S, L]:
    """Accept the step of each problem for which it `is_better`; increase the damping of the others."""
    with np.errstate(invalid="ignore"):
        drop = active.cost - cost
        # A step from an infinite cost to another is accepted. If the decrease of the cost differs from its prediction
        # by rounding only, it contains no information on the damping.
        is_informative = np.isfinite(drop) & (np.abs(drop - expected_decrease) > _COST_ROUNDING * cost)
    drop = np.where(is_informative, drop, expected_decrease)
    gain = np.clip(drop / expected_decrease, -_LARGEST_GAIN, _LARGEST_GAIN)
    decreased_damping = np.maximum(active.damping * np.maximum(0.1, 1 - (2 * gain - 1) ** 3), least_damping)
    # With less damping than that of Gauss-Newton steps, nearly the same step would be tried again.
    increased_damping = np.maximum(active.damping, _GAUSS_NEWTON_DAMPING) * active.growth
    return _Active(
        active.row,
        choose_entries(is_better, candidate, active.state),
        np.where(is_better, cost, active.cost),
        choose_entries(is_better, linearisation, active.linearisation),
        active.dof,
        np.where(is_better, decreased_damping, increased_damping),
        np.where(is_better, 2.0, active.growth * 2),
        np.where(is_better, expected_decrease, active.expected),
        residual_curvature,
    )


def _is_near(active: _Active[S, L], expected_decrease: Array) -> BoolArray:
    """Whether a step is so near an optimum that its secant describes the curvature there, (b,): at most one sigma."""
    near: BoolArray = expected_decrease <= np.minimum(_scale(active), _NEAR_SHARE * active.cost)
    return near


def _updated_curvature(active: _Active[S, L], linearisation: L, step: Array, is_near: BoolArray) -> Array | None:
    """Second-order curvature of the residuals after a step, (b, p, p); None if the Hessian is sparse."""
    if isinstance(linearisation.hessian, SparseHessian):
        return None
    assert active.residual_curvature is not None
    change = linearisation.gradient - active.linearisation.gradient
    return with_secant(active.residual_curvature, linearisation.hessian, change, step, is_near)


def _next_step(active: _Active[S, L]) -> tuple[Array, Array]:
    """Damped step (b, p) and its predicted decrease of the cost, (b,)."""
    linearisation, curvature = active.linearisation, active.residual_curvature
    if curvature is None or isinstance(linearisation.hessian, SparseHessian) or not curvature.any():
        step = _damped_step(linearisation, active.damping)
        return step, _quadratic(linearisation, step) + linearisation.eliminated_cost
    hessian = linearisation.hessian + usable_curvature(curvature, linearisation.hessian)
    curved = Quadratic(linearisation.cost, linearisation.gradient, hessian)
    step = _damped_step(curved, active.damping)
    expected = _quadratic(curved, step)
    downhill = expected > 0
    if not downhill.all():
        plain = _damped_step(linearisation, active.damping)
        step = np.where(downhill[:, None], step, plain)
        expected = np.where(downhill, expected, _quadratic(linearisation, plain))
    return step, expected + linearisation.eliminated_cost


def _quadratic(model: Linearised, step: Array) -> Array:
    """Quadratic form `step' H step`, (b,)."""
    if isinstance(model.hessian, SparseHessian):
        return model.hessian.quadratic(step)
    return np.asarray(np.einsum("bi,bij,bj->b", step, model.hessian, step))


def _damped_step(model: Linearised, damping: Array) -> Array:
    if isinstance(model.hessian, SparseHessian):
        return model.hessian.damped_step(model.gradient, damping)
    diagonal = np.diagonal(model.hessian, axis1=1, axis2=2)
    scale = 1 / np.sqrt(np.maximum(diagonal, 1e-12 * diagonal.max(axis=1, initial=1e-300, keepdims=True)))
    scaled = model.hessian * scale[..., None, :] * scale[..., :, None]
    of_diagonal = np.einsum("...ii->...i", scaled)  # a view
    of_diagonal += damping[:, None]
    step: Array = -scale * np.linalg.solve(scaled, (scale * model.gradient)[..., None])[..., 0]
    return step


def _linearise(system: System[S, L], state: S, previous: L) -> tuple[L, Array]:
    """Linearise the problems at their states; the cost is infinite for a problem that cannot be linearised."""
    try:
        linearisation = system.linearise(state)
    except np.linalg.LinAlgError:
        singles: list[L] = []
        cost = np.full(len(previous.cost), np.inf)
        for row in range(len(cost)):
            rows = np.array([row])
            try:
                singles.append(system.take(rows).linearise(take(state, rows)))
                cost[row] = singles[row].cost[0]
            except np.linalg.LinAlgError:
                singles.append(take(previous, rows))
        return concatenate(singles), cost
    return linearisation, linearisation.cost
