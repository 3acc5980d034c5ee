"""Joints that bring the flange to a pose."""

from __future__ import annotations

import numpy as np

from basecal.errors import InputError, NotConverged
from basecal.geometry import SE3, Array
from basecal.geometry.se3 import right_jacobian_inverse
from basecal.kinematics.chain import SerialChain

_DAMPING = 1e-4
_SMALLEST_DAMPING, _LARGEST_DAMPING = 1e-12, 1e10
_LARGEST_STEP = 1.0  # [rad]; further, the linear model sends the arm through its singular poses


def inverse(
    chain: SerialChain, base_from_flange: SE3, start: Array, *, tolerance: float = 1e-10, iterations: int = 200
) -> Array:
    """Joints within the limits that bring the flange to `base_from_flange`, (n,) [rad].

    Args:
        chain: The arm.
        base_from_flange: One pose.
        start: (n,) [rad]; of the solutions, one near here is given; far from all of them there may be a dead end.
        tolerance: Largest entry of the remaining tangent [m, rad].
        iterations: Steps tried at most.

    Raises:
        InputError: if `start` is not n finite numbers, or the pose a batch.
        NotConverged: if the pose is not reached; its `state` holds the joints of the nearest pose found.

    Source: Levenberg 1944, Marquardt 1963; joints on a limit that would leave it are held, as in Bertsekas 1982.
    """
    q = np.array(start, dtype=np.float64)
    if q.shape != (chain.n,) or not np.all(np.isfinite(q)):
        raise InputError(f"start has shape {q.shape}, expected {chain.n} finite joints")
    if base_from_flange.translation.shape != (3,):
        raise InputError("inverse takes one pose, not a batch")
    q = q.clip(chain.lower, chain.upper)
    damping, left = _DAMPING, _left(chain, q, base_from_flange)
    for _ in range(iterations):
        if np.abs(left).max() <= tolerance or damping > _LARGEST_DAMPING:
            break
        tried = _step(chain, q, left, damping)
        left_then = _left(chain, tried, base_from_flange)
        better = left_then @ left_then < left @ left
        damping = max(0.1 * damping, _SMALLEST_DAMPING) if better else 10.0 * damping
        q, left = (tried, left_then) if better else (q, left)
    if np.abs(left).max() <= tolerance:
        return q
    millimetres, degrees = 1e3 * np.linalg.norm(left[:3]), np.degrees(np.linalg.norm(left[3:]))
    message = (
        f"the flange stays {millimetres:.3g} mm and {degrees:.3g} deg away; give a nearer start or check the reach"
    )
    raise NotConverged(message, q)


def _left(chain: SerialChain, q: Array, base_from_flange: SE3) -> Array:
    """Tangent of what is left to go, (6,)."""
    return (chain.forward(q).inverse() @ base_from_flange).log()


def _step(chain: SerialChain, q: Array, left: Array, damping: float) -> Array:
    # d left = -J_l(left)^-1 J dq, and J_l(x) == J_r(-x).
    jacobian = right_jacobian_inverse(-left) @ chain.jacobian(q)
    downhill = jacobian.T @ left
    held = ((q <= chain.lower) & (downhill < 0)) | ((q >= chain.upper) & (downhill > 0))
    jacobian[:, held] = 0.0
    normal = jacobian.T @ jacobian + damping * np.eye(chain.n)
    step = np.linalg.solve(normal, jacobian.T @ left)
    step *= min(1.0, _LARGEST_STEP / max(np.abs(step).max(), _LARGEST_STEP))
    return (q + step).clip(chain.lower, chain.upper)
