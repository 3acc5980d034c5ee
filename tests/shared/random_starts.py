"""Batched descents from many random starts, for one camera and target whose views are poses."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from basecal.estimation.start.closed_form import Loop, Rotations, solve_translations
from basecal.geometry import SE3, Array
from basecal.geometry.rotation import rotation_from_quaternion
from basecal.geometry.se3_jacobians import right_jacobian_inverse

_CONVERGED_GAIN = 1e-7
_FIRST_DAMPING = 1e-4
_LARGEST_DAMPING = 1e8


class Trio(NamedTuple):
    """m values of X, Y and Z in A X B = Y C Z."""

    x: SE3
    y: SE3
    z: SE3

    def take(self, rows: Array) -> Trio:
        """Values at these rows."""
        return Trio(self.x[rows], self.y[rows], self.z[rows])


def random_rotations(rng: np.random.Generator, count: int) -> Array:
    """Rotations uniform over all, (count, 3, 3)."""
    q = rng.standard_normal((count, 4))
    return rotation_from_quaternion(q / np.linalg.norm(q, axis=-1, keepdims=True))


def random_trio(loop: Loop, rng: np.random.Generator, count: int) -> Trio:
    """Random rotations of the unknowns, with the translations that fit them best."""
    triples = []
    for _ in range(count):
        x, y, z = (
            random_rotations(rng, 1)[0] if known is None else known.rotation for known in (loop.x, loop.y, loop.z)
        )
        triples.append(solve_translations(loop, Rotations(x, y, z, True)))
    return Trio(*(SE3.stack(list(each)) for each in zip(*triples, strict=True)))


def _with_batch_axis(pose: SE3) -> SE3:
    return SE3(pose.rotation[:, None], pose.translation[:, None])


def _errors(loop: Loop, trio: Trio, weight: Array) -> tuple[Array, SE3, SE3]:
    """Residuals over sigmas (m, n, 6), `camera_from_target` and C Z, (m, n)."""
    cz = loop.c @ _with_batch_axis(trio.z)
    predicted = (loop.a @ _with_batch_axis(trio.x)).inverse() @ (_with_batch_axis(trio.y) @ cz)
    return (loop.b.inverse() @ predicted).log() * weight, predicted, cz


def _normal(loop: Loop, trio: Trio, weight: Array) -> tuple[Array, Array, Array]:
    """Costs (m,), gradients (m, k) and Hessians (m, k, k) of the unknowns."""
    error, predicted, cz = _errors(loop, trio, weight)
    inner = right_jacobian_inverse(error / weight) * weight[..., None]
    jacobians = {"x": lambda: -inner @ predicted.inverse().adjoint(), "y": lambda: inner @ cz.inverse().adjoint()}
    jacobian = np.concatenate([jacobians[u]() if u in jacobians else inner for u in loop.unknown], -1)
    m = len(error)
    flat, residual = jacobian.reshape(m, -1, jacobian.shape[-1]), error.reshape(m, -1, 1)
    transposed = np.swapaxes(flat, -1, -2)
    return np.sum(residual[..., 0] ** 2, -1), (transposed @ residual)[..., 0], transposed @ flat


def _retract(loop: Loop, trio: Trio, step: Array) -> Trio:
    values = trio._asdict()
    for i, name in enumerate(loop.unknown):
        values[name] = values[name] @ SE3.exp(step[:, 6 * i : 6 * i + 6])
    return Trio(**values)


def least_cost(loop: Loop, weight: Array, start: Trio, limit: float, iterations: int = 60) -> float:
    """The least sum of squares that any start leads to.

    A start ends when its cost no longer decreases: it is at an optimum, good or bad.

    Args:
        loop: A, B, C and the known transforms.
        weight: (n, 6) 1 / sigma.
        start: m starts.
        limit: The cost to be undercut; starts that slow down above twice this cost end early.
        iterations: Largest number of iterations.
    """
    least, damping = np.inf, np.full(len(start.x), _FIRST_DAMPING)
    trio = start
    cost, gradient, hessian = _normal(loop, trio, weight)
    for _ in range(iterations):
        scale = np.maximum(np.diagonal(hessian, axis1=-2, axis2=-1), 1e-9)
        matrix = hessian + np.eye(hessian.shape[-1]) * (damping[:, None] * scale)[:, None]
        candidate = _retract(loop, trio, -np.linalg.solve(matrix, gradient[..., None])[..., 0])
        new_cost, new_gradient, new_hessian = _normal(loop, candidate, weight)
        better = new_cost <= cost
        gain = np.where(better, cost - new_cost, 0.0)
        choose = [np.where(better.reshape(-1, *[1] * (a.ndim - 1)), b, a) for a, b in _pairs(trio, candidate)]
        trio = Trio(*(SE3(choose[2 * i], choose[2 * i + 1]) for i in range(3)))
        gradient = np.where(better[:, None], new_gradient, gradient)
        hessian = np.where(better[:, None, None], new_hessian, hessian)
        cost = np.where(better, new_cost, cost)
        damping = np.where(better, damping * 0.2, damping * 8)
        least = min(least, float(cost.min()))
        converged = better & (gain < np.where(cost > 2 * limit, 1e-3, _CONVERGED_GAIN) * cost)
        active = np.flatnonzero(~converged & (damping < _LARGEST_DAMPING))
        if not len(active):
            break
        trio, damping = trio.take(active), damping[active]
        cost, gradient, hessian = cost[active], gradient[active], hessian[active]
    return least


def _pairs(old: Trio, new: Trio) -> list[tuple[Array, Array]]:
    return [
        pair
        for a, b in zip(old, new, strict=True)
        for pair in ((a.rotation, b.rotation), (a.translation, b.translation))
    ]


def least_value(form: Array, count: int, rng: np.random.Generator, starts: int, sweeps: int = 30) -> float:
    """The least value of a form on products of `count` unit quaternions, over random starts."""
    factors = rng.standard_normal((count, starts, 4))
    factors /= np.linalg.norm(factors, axis=-1, keepdims=True)
    tensor = form.reshape((4,) * (2 * count))
    flat = []
    for j in range(count):
        rest = [i for i in range(count) if i != j]
        order = [j, count + j, *rest, *(count + i for i in rest)]
        flat.append(tensor.transpose(order).reshape(16, -1))
    least = np.zeros(starts)
    for _ in range(sweeps):
        for j in range(count):
            rest = [factors[i] for i in range(count) if i != j]
            product = np.ones((starts, 1))
            for factor in rest:
                product = (product[:, :, None] * factor[:, None, :]).reshape(starts, -1)
            pairs = (product[:, :, None] * product[:, None, :]).reshape(starts, -1)
            values, vectors = np.linalg.eigh((pairs @ flat[j].T).reshape(starts, 4, 4))
            factors[j], least = vectors[:, :, 0], values[:, 0]
    return float(least.min())
