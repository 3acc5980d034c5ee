"""Inverse kinematics by Levenberg-Marquardt."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from basecal.errors import InputError, NotConverged
from basecal.geometry import SE3, Array, IntArray
from basecal.geometry.se3_jacobians import right_jacobian_inverse
from basecal.kinematics.chain import SerialChain
from basecal.numerics.levenberg_marquardt import Criteria, Quadratic, levenberg_marquardt

_LARGEST_STEP_RAD = 1.0  # with larger steps the linear model moves the arm through singular poses


def inverse(
    chain: SerialChain, base_from_flange: SE3, start: Array, *, tolerance: float = 1e-10, iterations: int = 200
) -> Array:
    """Joints within the limits at which the flange is at `base_from_flange`, (..., n) [rad].

    Args:
        chain: The arm.
        base_from_flange: One pose, or a batch (b,) of poses.
        start: (n,) or (b, n) initial joints [rad]. A solution near them is returned; far from all solutions, the
            iteration may end in a local minimum.
        tolerance: Largest entry of the remaining tangent [m, rad].
        iterations: Most steps.

    Raises:
        InputError: if `start` is not n finite numbers, for each pose or for all.
        NotConverged: if a pose is not reached; the error's `state` holds the joints of the nearest poses found.

    Source: Levenberg 1944, Marquardt 1963; joints on a limit that would leave it are held, as in Bertsekas 1982.
    """
    start, shape = np.asarray(start, dtype=np.float64), (*base_from_flange.shape, chain.n)
    if start.shape not in {(chain.n,), shape} or not np.all(np.isfinite(start)):
        raise InputError(f"start has shape {start.shape}, expected {chain.n} finite joints for each pose or for all")
    poses = base_from_flange if base_from_flange.shape else SE3.stack([base_from_flange])
    q = np.broadcast_to(start, (len(poses), chain.n)).clip(chain.lower, chain.upper)
    arm = _Arm(chain, poses)
    if np.abs(remaining := arm.remaining_tangent(q)).max(initial=0.0) > tolerance:
        q = levenberg_marquardt(arm, q, Criteria(iterations)).state
        remaining = arm.remaining_tangent(q)
    if np.abs(remaining).max(initial=0.0) <= tolerance:
        return q.reshape(shape)
    farthest = remaining[np.abs(remaining).max(axis=1).argmax()]
    millimetres, degrees = 1e3 * np.linalg.norm(farthest[:3]), np.degrees(np.linalg.norm(farthest[3:]))
    message = (
        f"the flange stays {millimetres:.3g} mm and {degrees:.3g} deg away; give a nearer start or check the reach"
    )
    raise NotConverged(message, q.reshape(shape))


@dataclass(frozen=True, eq=False)
class _Arm:
    """An arm and target poses of its flange, (b,), as a `System` for Levenberg-Marquardt."""

    chain: SerialChain
    base_from_flange: SE3

    def remaining_tangent(self, q: Array) -> Array:
        """Tangents from the present flange poses to the target poses, (b, 6) [m, rad]."""
        return (self.chain.forward(q).inverse() @ self.base_from_flange).log()

    def linearise(self, q: Array) -> Quadratic:
        """See `System`; joints at a limit that would exceed it are held."""
        posture = self.chain.posture(q)
        reached, by_joints = posture.base_from_flange, posture.joint_derivative
        remaining = (reached.inverse() @ self.base_from_flange).log()
        # d remaining = -J_l(remaining)^-1 J dq, and J_l(x) == J_r(-x).
        jacobian = right_jacobian_inverse(-remaining) @ by_joints
        gradient = -(jacobian.mT @ remaining[..., None])[..., 0]
        held = ((q <= self.chain.lower) & (gradient > 0)) | ((q >= self.chain.upper) & (gradient < 0))
        jacobian = np.where(held[:, None], 0.0, jacobian)
        hessian = jacobian.mT @ jacobian
        return Quadratic((remaining**2).sum(axis=1), np.where(held, 0.0, gradient), hessian)

    def retract(self, q: Array, model: Quadratic, step: Array) -> Array:
        """See `System`; steps are limited in length and clipped to the joint limits."""
        share = _LARGEST_STEP_RAD / np.maximum(np.abs(step).max(axis=1, keepdims=True), _LARGEST_STEP_RAD)
        joints: Array = (q + share * step).clip(self.chain.lower, self.chain.upper)
        return joints

    def take(self, rows: IntArray) -> _Arm:
        """See `System`."""
        return _Arm(self.chain, self.base_from_flange[rows])
