"""Minimise a quadratic form on products of unit quaternions, and prove a lower bound.

The form is v'Mv with v = p (x) q (x) ... , where each factor is a unit vector in R^4. The form does not change if a
matrix D is added to M that vanishes on all such products. Such matrices exist, since exchanging the row and column
indices of one factor leaves vv' unchanged. For any such D, the smallest eigenvalue of M + D is therefore a lower bound.
If it equals the value at some product, this value is the minimum. D is found by Newton's method on a barrier function,
with steps from conjugate gradients. The bound follows from the eigenvalues of M + D alone, so errors of D do not
invalidate it.

Source: Lasserre 2001 (duals of moment relaxations); docs/mathematics.md (10.4).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from typing import NamedTuple

import numpy as np
import scipy  # its parts are loaded when they are first used

from basecal.estimation.start.closed_form import kron
from basecal.geometry import Array, IntArray

Factors = tuple[Array, ...]
Operator = Callable[[Array], Array]

_MOST_SWEEPS = 300  # most alternations: each decreases the form, and most converge after tens
_VALUE_ROUNDING = 1e-15  # change of a form of unit scale that is rounding
_DUAL_STEPS = 25  # most Newton steps of the dual; if the relaxation is tight they converge quadratically
_BARRIER_GAPS = 4.0  # barrier weight relative to the inverse gap: the bound rises fast and stays feasible
_STOP_GAP = 0.1  # relative gap at which the dual may stop
_SMALLEST_GAP = 1e-9  # gap of a form of unit scale: smaller gaps are rounding
_STEP_SHARE = 0.9  # share of the step to the boundary of the positive definite cone: a margin for rounding
_MOST_CG_STEPS = 150  # most steps of conjugate gradients
_CG_TOLERANCE = 1e-2  # relative to the first residual: an inexact Newton step is sufficient


class Bound(NamedTuple):
    """Least value found, with a proven lower bound.

    Attributes:
        factors: Unit vectors (4,) at which the value is attained.
        value: Value of the form at `factors`.
        lower: Proven lower bound of the form on products of unit vectors.
        growth: The form at v is at least `lower + growth * (1 - (v' best)^2)`, with `best` the product of `factors`.
    """

    factors: Factors
    value: float
    lower: float
    growth: float


def kronecker_product(factors: Sequence[Array]) -> Array:
    """Kronecker product of vectors; (1,) with the number one if there are none."""
    product = np.ones(1)
    for factor in factors:
        product = np.outer(product, factor).ravel()
    return product


def local_minimum(form: Array, factors: Factors, sweeps: int = _MOST_SWEEPS) -> tuple[Factors, float]:
    """Find a local minimum from `factors` by block coordinate descent: one factor at a time is optimised exactly.

    Args:
        form: (4^k, 4^k) symmetric.
        factors: k unit vectors (4,).
        sweeps: Most sweeps over all factors.
    """
    current, value = list(factors), np.inf
    unfolded = [_unfold_factor(form, j, len(current)) for j in range(len(current))]
    for _ in range(sweeps):
        previous = value
        for j in range(len(current)):
            others = kronecker_product([f for i, f in enumerate(current) if i != j])
            values, vectors = np.linalg.eigh((unfolded[j] @ np.outer(others, others).ravel()).reshape(4, 4))
            current[j], value = vectors[:, 0], float(values[0])
        if previous - value <= _VALUE_ROUNDING:
            break
    return tuple(current), value


def _unfold_factor(form: Array, factor: int, count: int) -> Array:
    """Reshape the form to (16, 16^(k - 1)): rows are the indices of one factor, columns those of the others."""
    others = [i for i in range(count) if i != factor]
    order = [factor, count + factor, *others, *(count + i for i in others)]
    return form.reshape((4,) * (2 * count)).transpose(order).reshape(16, -1)


def lower_bound(form: Array, factors: Factors) -> Bound:
    """Prove a lower bound of the form from a minimum at `factors`, the result of `local_minimum`.

    Args:
        form: (4^k, 4^k) symmetric, with entries of order one.
        factors: k unit vectors (4,).
    """
    axes = np.ones((1, 1))
    for factor in factors:
        axes = kron(axes, _complete_basis(factor))
    rotated_form = axes.T @ form @ axes
    value = float(rotated_form[0, 0])
    lifted = _clear_first_row(rotated_form, len(factors))
    inner = lifted[1:, 1:] - value * np.eye(len(rotated_form) - 1)
    lifted[1:, 1:] = _maximise_dual(inner, len(factors)) + value * np.eye(len(rotated_form) - 1)
    values = np.linalg.eigvalsh(lifted)
    leak = float(np.linalg.norm(_exchange_mean(lifted - rotated_form, len(factors)), 2))
    return Bound(factors, value, float(values[0]) - leak, float(values[1] - values[0]))


def _complete_basis(unit: Array) -> Array:
    """An orthogonal matrix (4, 4) whose first column is `unit`."""
    a, b, c, d = unit
    return np.array([[a, -b, -c, -d], [b, a, -d, c], [c, d, a, -b], [d, -c, b, a]])


def _exchange_mean(matrix: Array, count: int) -> Array:
    """Part of a matrix that has an effect on products: its mean over all exchanges of a factor's indices."""
    return _class_means(matrix, _classes(count))


def _class_means(matrix: Array, classes: IntArray) -> Array:
    """Replace each entry of a matrix by the mean of its class."""
    flat = classes.ravel()
    means: Array = np.bincount(flat, matrix.ravel()) / np.maximum(np.bincount(flat), 1)
    return means[classes]


@cache
def _classes(count: int) -> IntArray:
    """Class numbers of matrix entries, (4^k, 4^k); exchanges map entries of a class to one another."""
    digits = np.stack(np.unravel_index(np.arange(4**count), (4,) * count), -1)
    low, high = np.minimum(digits[:, None], digits[None]), np.maximum(digits[:, None], digits[None])
    pairs = (4 * low + high) @ 16 ** np.arange(count)
    return np.asarray(np.unique(pairs, return_inverse=True)[1].reshape(pairs.shape), dtype=np.int64)


def _clear_first_row(form: Array, count: int) -> Array:
    """Move the first row and column of the form to the other entries of their classes, if there are any."""
    classes = _classes(count)
    inner, first = classes[1:, 1:], classes[0, 1:]
    members = np.bincount(inner.ravel()) / 2
    moves = members[first] > 0
    share = np.zeros(len(members))
    share[first[moves]] = form[0, 1:][moves] / members[first[moves]]
    cleared = form.copy()
    cleared[1:, 1:] += share[inner]
    cleared[0, 1:] = cleared[1:, 0] = np.where(moves, 0.0, form[0, 1:])
    return cleared


def _vanishing_projection(count: int) -> Operator:
    """Projection onto the matrices that vanish on products, without the first row and column."""
    inner = _classes(count)[1:, 1:]
    return lambda matrix: matrix - _class_means(matrix, inner)


def _maximise_dual(form: Array, count: int) -> Array:
    """Add a matrix E that vanishes on products to the form, so that its smallest eigenvalue is nearly maximal.

    Maximise level t + log det(form + E - level I) over E and the level, with t increasing in every step.
    """
    if count == 1:
        return form
    project, size = _vanishing_projection(count), len(form)
    values = np.linalg.eigvalsh(form)
    level, weight = float(values[0] - 0.1 * (values[-1] - values[0])), 0.0
    best, best_least = form, float(values[0])
    for _ in range(_DUAL_STEPS):
        try:
            root = np.linalg.inv(np.linalg.cholesky(form - level * np.eye(size)))
        except np.linalg.LinAlgError:
            break
        inverse = root.T @ root
        weight = max(weight, _BARRIER_GAPS * float(np.trace(inverse)))
        step, rise = _newton(inverse, weight, project)
        whitened_step = root @ (step - rise * np.eye(size)) @ root.T
        length = min(
            1.0, _STEP_SHARE / max(-float(np.linalg.eigvalsh(0.5 * (whitened_step + whitened_step.T))[0]), 1e-12)
        )
        form, level = form + length * step, level + length * rise
        least = float(np.linalg.eigvalsh(form)[0])
        if least > best_least:
            best, best_least = form, least
        if size / np.trace(inverse) < max(_STOP_GAP * abs(least), _SMALLEST_GAP):
            break
    return best


def _newton(inverse: Array, weight: float, project: Operator) -> tuple[Array, float]:
    """Newton step of E and of the level."""
    squared = inverse @ inverse
    curvature, across = float(np.trace(squared)), -project(squared)
    force = float(np.trace(inverse)) - weight

    def hessian(step: Array) -> Array:
        """Product of the barrier's Hessian and a step."""
        return project(inverse @ step @ inverse) - across * (float(np.vdot(across, step)) / curvature)

    step = _solve_conjugate_gradients(hessian, project(inverse) + across * (force / curvature))
    return step, (-force - float(np.vdot(across, step))) / curvature


def _solve_conjugate_gradients(operator: Operator, right: Array) -> Array:
    """Solve a linear system by conjugate gradients, with a relative tolerance of 1e-2."""
    flat = scipy.sparse.linalg.LinearOperator(
        (right.size, right.size), lambda step: operator(step.reshape(right.shape)).ravel(), dtype=right.dtype
    )
    solve, limits = scipy.sparse.linalg.cg, {"rtol": _CG_TOLERANCE, "maxiter": _MOST_CG_STEPS}
    solution: Array = solve(flat, right.ravel(), **limits)[0]
    return solution.reshape(right.shape)
