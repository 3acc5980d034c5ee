"""A serial arm: where its flange is, and how that moves with joints and with the links themselves."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from basecal.errors import InputError
from basecal.geometry import SE3, Array, read_only
from basecal.geometry.se3 import rotation_exp
from basecal.kinematics.masses import Masses


@dataclass(frozen=True, eq=False)
class SerialChain:
    """Revolute joints one after another, or a batch of arms that differ in their links alone.

    `base_from_flange` is the product of `origins[i] @ turn(axes[i], joints[i])` over the joints, and of `tip`. Joints
    of a batch of arms are (b, m, n), or (m, n) where all take the same.

    Attributes:
        joint_names: From base to flange, n of them.
        origins: ([b,] n) where each joint stands in the frame after the joint before it.
        axes: (n, 3) unit axes in the joints' own frames.
        tip: ([b,]) `last_joint_from_flange`.
        lower: (n,) [rad], -inf where there is no limit.
        upper: (n,) [rad], inf where there is no limit.
        masses: What hangs on the joints; None where it is not known.

    Raises:
        InputError: if a shape is not as above or an axis not a unit vector.
    """

    joint_names: tuple[str, ...]
    origins: SE3
    axes: Array
    tip: SE3
    lower: Array
    upper: Array
    masses: Masses | None = None

    def __post_init__(self) -> None:
        n = len(self.joint_names)
        if n == 0:
            raise InputError("a chain has at least one joint")
        if self.origins.shape[-1:] != (n,) or self.origins.shape[:-1] != self.tip.shape:
            raise InputError(f"a chain of {n} joints needs {n} origins and one tip")
        for name, shape in (("axes", (n, 3)), ("lower", (n,)), ("upper", (n,))):
            object.__setattr__(self, name, read_only(getattr(self, name), shape, name))
        if not np.allclose(np.linalg.norm(self.axes, axis=-1), 1.0, rtol=0, atol=1e-9):
            raise InputError("the axes of a chain are unit vectors")
        if self.masses is not None and len(self.masses.kg) != n:
            raise InputError(f"masses of {len(self.masses.kg)} joints do not suit a chain of {n}")

    @property
    def n(self) -> int:
        """How many joints there are."""
        return len(self.joint_names)

    @property
    def batch(self) -> tuple[int, ...]:
        """The shape of the batch, () of a single arm."""
        return self.tip.shape

    def forward(self, joints: Array) -> SE3:
        """`base_from_flange`, (...).

        Args:
            joints: (..., n) [rad]; limits are not looked at.

        Raises:
            InputError: if the last axis is not n.
        """
        return self._tails(joints).base_from_flange

    def jacobian(self, joints: Array) -> Array:
        """Derivative of `base_from_flange` to the joints, (..., 6, n) [m/rad, rad/rad].

        Args:
            joints: (..., n) [rad].

        Returns:
            The right tangent: `forward(q + d) == forward(q) @ SE3.exp(jacobian(q) @ d)` to first order in d.

        Raises:
            InputError: if the last axis is not n.

        Source: Lynch & Park 2017, "Modern Robotics", 5.1.4 (the body Jacobian).
        """
        return self.forward_and_jacobian(joints)[1]

    def forward_and_jacobian(self, joints: Array) -> tuple[SE3, Array]:
        """What `forward` and `jacobian` give, by one way through the chain."""
        tails = self._tails(joints)
        axes = self._axes_over(tails.base_from_flange.translation.shape[:-1])
        flange_from_joint = np.swapaxes(tails.joint_from_flange.rotation, -1, -2)
        lever = np.cross(axes, tails.joint_from_flange.translation)
        columns = flange_from_joint @ np.stack([lever, axes], -1)
        over_joints = np.concatenate([columns[..., 0], columns[..., 1]], -1)
        return tails.base_from_flange, np.ascontiguousarray(np.moveaxis(over_joints, 0, -1))

    def link_jacobian(self, joints: Array) -> Array:
        """Derivative of `base_from_flange` to right perturbations of each origin, then of the tip, (..., 6, 6 (n + 1)).

        Args:
            joints: (..., n) [rad].

        Returns:
            The right tangent: `moved(d).forward(q) == forward(q) @ SE3.exp(link_jacobian(q) @ d.ravel())`, first order.

        Raises:
            InputError: if the last axis is not n.
        """
        tails = self._tails(joints)
        batch = tails.base_from_flange.translation.shape[:-1]
        blocks = (tails.turns @ tails.joint_from_flange).inverse().adjoint()
        with_tip = np.concatenate([blocks, np.broadcast_to(np.eye(6), (1, *batch, 6, 6))])
        return np.moveaxis(with_tip, 0, -2).reshape(*batch, 6, 6 * (self.n + 1))

    def moved(self, link_tangents: Array) -> SerialChain:
        """The chain with each origin, and last the tip, perturbed on the right by (..., n + 1, 6) [m, rad].

        Raises:
            InputError: if the shape does not end with (n + 1, 6).
        """
        tangents = np.asarray(link_tangents, dtype=np.float64)
        if tangents.shape[-2:] != (self.n + 1, 6):
            raise InputError(f"link_tangents have shape {tangents.shape}, expected (..., {self.n + 1}, 6)")
        of_origins, of_tip = SE3.exp(tangents[..., :-1, :]), SE3.exp(tangents[..., -1, :])
        return replace(self, origins=self.origins @ of_origins, tip=self.tip @ of_tip)

    def joint_frames(self, joints: Array) -> list[SE3]:
        """`base_from_joint` of each joint's own frame, which turns with it, n of (...).

        Args:
            joints: (..., n) [rad]; of a single arm.
        """
        over_joints = np.moveaxis(np.asarray(joints, dtype=np.float64), -1, 0)
        frame, frames = SE3.identity(over_joints.shape[1:]), []
        for i, angle in enumerate(over_joints):
            turn = SE3.adopt(rotation_exp(angle[..., None] * self.axes[i]), np.zeros((*angle.shape, 3)))
            frame = frame @ self.origins[i] @ turn
            frames.append(frame)
        return frames

    def _tails(self, joints: Array) -> _Tails:
        q = np.asarray(joints, dtype=np.float64)
        if q.shape[-1:] != (self.n,):
            raise InputError(f"joints have shape {q.shape}, expected (..., {self.n}): {', '.join(self.joint_names)}")
        if self.batch:
            q = np.broadcast_to(q, (*np.broadcast_shapes((*self.batch, 1), q.shape[:-1]), self.n))
        over_joints = np.moveaxis(q, -1, 0)
        turns = SE3.adopt(
            rotation_exp(over_joints[..., None] * self._axes_over(q.shape[:-1])), np.zeros((*over_joints.shape, 3))
        )
        tail = SE3.identity(q.shape[:-1]) @ (self.tip.spread() if self.batch else self.tip)
        tails = []
        for i in reversed(range(self.n)):
            tails.append(tail)
            tail = self._origin(i) @ (turns[i] @ tail)
        return _Tails(tail, turns, SE3.stack(tails[::-1]))

    def _origin(self, joint: int) -> SE3:
        """One of the origins; of a batch (b, 1), which broadcasts against its joints."""
        if not self.batch:
            return self.origins[joint]
        return SE3.adopt(self.origins.rotation[..., joint, :, :], self.origins.translation[..., joint, :]).spread()

    def _axes_over(self, batch: tuple[int, ...]) -> Array:
        """The axes once per entry of a batch, (n, *batch, 3)."""
        spread = self.axes.reshape(self.n, *[1] * len(batch), 3)
        return np.broadcast_to(spread, (self.n, *batch, 3))


class _Tails(NamedTuple):
    """What the joints make of the chain; the joints are the leading axis."""

    base_from_flange: SE3
    turns: SE3
    joint_from_flange: SE3
