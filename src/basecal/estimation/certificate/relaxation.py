"""The least value of a form on products of unit quaternions, and a proof that it is the least.

The form is v'Mv on v = p (x) q (x) ... , with each factor a unit vector of four numbers. It does not change when a
matrix is added that vanishes on all such products. Such matrices exist, since exchanging the indices of one factor
between row and column leaves vv' unchanged. The smallest eigenvalue of M + D, with any such D, is therefore a lower
bound. If one D lifts it to a value that is attained, that value is the least. D is found by Newton's method on a
barrier, its steps by conjugate gradients. The bound is then taken from the eigenvalues of M + D alone, whatever led to
D.

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

_MOST_SWEEPS = 300  # alternations at most: each lowers the form, and most stand still after tens
_STANDSTILL = 1e-15  # change of a form of unit scale that is rounding
_DUAL_STEPS = 25  # Newton steps of the dual at most; where it is tight they converge quadratically
_BARRIER_GAPS = 4.0  # gaps wide the barrier pulls: the bound rises fast and stays inside
_STOP_GAP = 0.1  # of the least value: the gap at which the dual may stop
_SMALLEST_GAP = 1e-9  # of a form of unit scale: smaller gaps are rounding
_STEP_SHARE = 0.9  # of the way to where the matrix stops being positive: inside with room for rounding
_MOST_GRADIENTS = 150  # conjugate gradients on at most 256 unknowns
_GRADIENT_TOLERANCE = 1e-2  # of the first gradient: an inexact Newton step is as good from here


class Bound(NamedTuple):
    """The least value found and what is proven of it.

    Attributes:
        factors: Unit vectors (4,) that attain it.
        value: The form there.
        lower: No product of unit vectors has a smaller value.
        growth: At v the form is at least `lower + growth * (1 - (v' best)^2)`, `best` the product of `factors`.
    """

    factors: Factors
    value: float
    lower: float
    growth: float


def kronecker_product(factors: Sequence[Array]) -> Array:
    """Kronecker product of vectors; of none, the number one."""
    whole = np.ones(1)
    for factor in factors:
        whole = np.outer(whole, factor).ravel()
    return whole


def local_minimum(form: Array, factors: Factors, sweeps: int = _MOST_SWEEPS) -> tuple[Factors, float]:
    """A least value downhill of `factors`: one factor at a time becomes the best that the others leave.

    Args:
        form: (4^k, 4^k) symmetric.
        factors: k unit vectors (4,).
        sweeps: At most.
    """
    found, value = list(factors), np.inf
    left = [_unfold_factor(form, j, len(found)) for j in range(len(found))]
    for _ in range(sweeps):
        before = value
        for j in range(len(found)):
            others = kronecker_product([f for i, f in enumerate(found) if i != j])
            values, vectors = np.linalg.eigh((left[j] @ np.outer(others, others).ravel()).reshape(4, 4))
            found[j], value = vectors[:, 0], float(values[0])
        if before - value <= _STANDSTILL:
            break
    return tuple(found), value


def _unfold_factor(form: Array, factor: int, count: int) -> Array:
    """The form's entries by the indices of one factor, (16, 16^(k - 1)), those of the others after them."""
    others = [i for i in range(count) if i != factor]
    order = [factor, count + factor, *others, *(count + i for i in others)]
    return form.reshape((4,) * (2 * count)).transpose(order).reshape(16, -1)


def lower_bound(form: Array, factors: Factors) -> Bound:
    """Proven lower bound of the value at `factors`, a minimum by `local_minimum`.

    Args:
        form: (4^k, 4^k) symmetric, of order one.
        factors: k unit vectors (4,).
    """
    axes = np.ones((1, 1))
    for factor in factors:
        axes = kron(axes, _with_first(factor))
    turned = axes.T @ form @ axes
    value = float(turned[0, 0])
    lifted = _clear_first_row(turned, len(factors))
    rest = lifted[1:, 1:] - value * np.eye(len(turned) - 1)
    lifted[1:, 1:] = _maximise_dual(rest, len(factors)) + value * np.eye(len(turned) - 1)
    values = np.linalg.eigvalsh(lifted)
    leak = float(np.linalg.norm(_exchange_mean(lifted - turned, len(factors)), 2))
    return Bound(factors, value, float(values[0]) - leak, float(values[1] - values[0]))


def _with_first(unit: Array) -> Array:
    """An orthogonal matrix (4, 4) whose first column is `unit`."""
    a, b, c, d = unit
    return np.array([[a, -b, -c, -d], [b, a, -d, c], [c, d, a, -b], [d, -c, b, a]])


def _exchange_mean(matrix: Array, count: int) -> Array:
    """The part of a matrix that products see: its mean over all exchanges of a factor's indices."""
    return _class_means(matrix, _classes(count))


def _class_means(matrix: Array, classes: IntArray) -> Array:
    """A matrix whose entries of each class are their mean."""
    flat = classes.ravel()
    means: Array = np.bincount(flat, matrix.ravel()) / np.maximum(np.bincount(flat), 1)
    return means[classes]


@cache
def _classes(count: int) -> IntArray:
    """Numbers of the classes of entries that exchanges carry into one another, (4^k, 4^k)."""
    digits = np.stack(np.unravel_index(np.arange(4**count), (4,) * count), -1)
    low, high = np.minimum(digits[:, None], digits[None]), np.maximum(digits[:, None], digits[None])
    pairs = (4 * low + high) @ 16 ** np.arange(count)
    return np.asarray(np.unique(pairs, return_inverse=True)[1].reshape(pairs.shape), dtype=np.int64)


def _clear_first_row(form: Array, count: int) -> Array:
    """The form with its first row and column given to the other entries of their classes, where there are such."""
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


def _vanishing(count: int) -> Operator:
    """Projection onto the matrices that vanish on products and leave the first row and column at rest."""
    inner = _classes(count)[1:, 1:]
    return lambda matrix: matrix - _class_means(matrix, inner)


def _maximise_dual(form: Array, count: int) -> Array:
    """The form plus what vanishes on products, its smallest eigenvalue raised about as far as it goes.

    Maximises level t + log det(form + E - level I) over E and the level, t growing with every step.
    """
    if count == 1:
        return form
    project, size = _vanishing(count), len(form)
    values = np.linalg.eigvalsh(form)
    level, pull = float(values[0] - 0.1 * (values[-1] - values[0])), 0.0
    best, best_least = form, float(values[0])
    for _ in range(_DUAL_STEPS):
        try:
            root = np.linalg.inv(np.linalg.cholesky(form - level * np.eye(size)))
        except np.linalg.LinAlgError:
            break
        inverse = root.T @ root
        pull = max(pull, _BARRIER_GAPS * float(np.trace(inverse)))
        step, rise = _newton(inverse, pull, project)
        moved = root @ (step - rise * np.eye(size)) @ root.T
        length = min(1.0, _STEP_SHARE / max(-float(np.linalg.eigvalsh(0.5 * (moved + moved.T))[0]), 1e-12))
        form, level = form + length * step, level + length * rise
        least = float(np.linalg.eigvalsh(form)[0])
        if least > best_least:
            best, best_least = form, least
        if size / np.trace(inverse) < max(_STOP_GAP * abs(least), _SMALLEST_GAP):
            break
    return best


def _newton(inverse: Array, pull: float, project: Operator) -> tuple[Array, float]:
    """Newton's step of E and of the level."""
    squared = inverse @ inverse
    curvature, across = float(np.trace(squared)), -project(squared)
    force = float(np.trace(inverse)) - pull

    def hessian(step: Array) -> Array:
        """The barrier's second derivative along a step."""
        return project(inverse @ step @ inverse) - across * (float(np.vdot(across, step)) / curvature)

    step = _solve_conjugate_gradients(hessian, project(inverse) + across * (force / curvature))
    return step, (-force - float(np.vdot(across, step))) / curvature


def _solve_conjugate_gradients(operator: Operator, right: Array) -> Array:
    """Conjugate gradients, to a hundredth."""
    flat = scipy.sparse.linalg.LinearOperator(
        (right.size, right.size), lambda step: operator(step.reshape(right.shape)).ravel(), dtype=right.dtype
    )
    solve, limits = scipy.sparse.linalg.cg, {"rtol": _GRADIENT_TOLERANCE, "maxiter": _MOST_GRADIENTS}
    found: Array = solve(flat, right.ravel(), **limits)[0]
    return found.reshape(right.shape)
