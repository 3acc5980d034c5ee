"""Serial kinematic chain: flange pose, derivatives with respect to joints and links, masses, collision bodies."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from basecal.errors import InputError, count_text
from basecal.geometry import SE3, Array, read_only
from basecal.geometry.array import ReadOnlyArrays
from basecal.geometry.rotation import cross_matrix
from basecal.kinematics.collision import Collision

LARGEST_JOINT_RAD = 2.2 * np.pi
"""Largest plausible joint angle [rad]: 1.1 revolutions. Larger values are continuous wrists, or degrees."""

LIMIT_EXCESS_RAD = 0.1
"""Tolerance of a URDF's joint limits [rad], since some files omit or round them."""


@dataclass(frozen=True, eq=False)
class SerialChain(ReadOnlyArrays):
    """Serial chain of revolute joints, or a batch of arms that differ in their links only.

    `base_from_flange` is the product of `origins[i] @ rotation(axes[i], joints[i])` over the joints, and of `tip`.
    Joints of a batch of arms are (b, m, n), or (m, n) if all arms have the same joints.

    Attributes:
        joint_names: Names of the n joints, from base to flange.
        origins: ([b,] n) pose of each joint in the rotated frame of the joint before it.
        axes: (n, 3) unit axes in the joints' own frames.
        tip: ([b,]) `last_joint_from_flange`.
        lower: (n,) lower limits [rad], -inf if there is no limit.
        upper: (n,) upper limits [rad], inf if there is no limit.
        masses: Masses carried by the joints; None if not known.
        collisions: Collision bodies of the links, from a URDF.

    Raises:
        InputError: if a shape is wrong, or an axis is not a unit vector.
    """

    joint_names: tuple[str, ...]
    origins: SE3
    axes: Array
    tip: SE3
    lower: Array
    upper: Array
    masses: Masses | None = None
    collisions: tuple[Collision, ...] = ()

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
            raise InputError(f"masses of {count_text(len(self.masses.kg), 'joint')} do not suit a chain of {n}")

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.joint_names)

    @property
    def batch(self) -> tuple[int, ...]:
        """Shape of the batch; () for a single arm."""
        return self.tip.shape

    def forward(self, joints: Array) -> SE3:
        """Forward kinematics `base_from_flange`, (...).

        Args:
            joints: (..., n) [rad]; limits are not checked.

        Raises:
            InputError: if the last axis is not n.
        """
        return self.posture(joints).base_from_flange

    def jacobian(self, joints: Array) -> Array:
        """Derivative of `base_from_flange` with respect to joints, (..., 6, n); see `ChainPosture.joint_derivative`."""
        return self.posture(joints).joint_derivative

    def posture(self, joints: Array) -> ChainPosture:
        """Compute the posture at given joints, with access to derivatives.

        Args:
            joints: (..., n) [rad]; limits are not checked.

        Raises:
            InputError: if the last axis is not n.
        """
        q = np.asarray(joints, dtype=np.float64)
        if q.shape[-1:] != (self.n,):
            raise InputError(f"joints have shape {q.shape}, expected (..., {self.n}): {', '.join(self.joint_names)}")
        if self.batch:
            q = np.broadcast_to(q, (*np.broadcast_shapes((*self.batch, 1), q.shape[:-1]), self.n))
        joint_rotations = self._joint_rotations(np.moveaxis(q, -1, 0))
        link_rotations, link_translations = self._origins(joint_rotations.ndim)
        link_rotations = link_rotations @ joint_rotations
        rotation, translation = np.empty(link_rotations.shape), np.empty(link_rotations.shape[:-1])
        rotation[-1], translation[-1] = (
            self._broadcast_tip(each) for each in (self.tip.rotation, self.tip.translation)
        )
        for i in range(self.n - 1, 0, -1):  # joint i - 1 to flange: origin and rotation of joint i, then the rest
            rotation[i - 1] = link_rotations[i] @ rotation[i]
            translation[i - 1] = (link_rotations[i] @ translation[i][..., None])[..., 0] + link_translations[i]
        flange_translation = (link_rotations[0] @ translation[0][..., None])[..., 0] + link_translations[0]
        return ChainPosture(
            self.axes,
            SE3.adopt(link_rotations[0] @ rotation[0], flange_translation),
            joint_rotations,
            SE3.adopt(rotation, translation),
        )

    def _joint_rotations(self, angles: Array) -> Array:
        """Rotations about the joint axes by angles (n, ...), (n, ..., 3, 3). Source: Rodrigues 1840."""
        crosses, squared = self._axis_matrices
        shape = (self.n, *[1] * (angles.ndim - 1), 3, 3)
        sine, versine = np.sin(angles)[..., None, None], (1 - np.cos(angles))[..., None, None]
        return np.asarray(np.eye(3) + sine * crosses.reshape(shape) + versine * squared.reshape(shape))

    @cached_property
    def _axis_matrices(self) -> tuple[Array, Array]:
        """Cross-product matrix of each axis, and its square, (n, 3, 3) each."""
        crosses = cross_matrix(self.axes)
        return crosses, crosses @ crosses

    def _origins(self, dimensions: int) -> tuple[Array, Array]:
        """Rotations and translations of the origins, joints first, to broadcast against arrays of `dimensions` axes."""
        rotation, translation = np.moveaxis(self.origins.rotation, -3, 0), np.moveaxis(self.origins.translation, -2, 0)
        shape = (self.n, *self.batch, *[1] * (dimensions - 3 - len(self.batch)))
        return rotation.reshape(*shape, 3, 3), translation.reshape(*shape, 3)

    def _broadcast_tip(self, tip: Array) -> Array:
        """Rotation or translation of the tip, with axes to broadcast against joints."""
        return np.expand_dims(tip, len(self.batch)) if self.batch else tip

    def perturb_links(self, link_tangents: Array) -> SerialChain:
        """Return the chain with right perturbations of each origin, and last of the tip, (..., n + 1, 6) [m, rad].

        Raises:
            InputError: if the shape does not end with (n + 1, 6).
        """
        tangents = np.asarray(link_tangents, dtype=np.float64)
        if tangents.shape[-2:] != (self.n + 1, 6):
            raise InputError(f"link_tangents have shape {tangents.shape}, expected (..., {self.n + 1}, 6)")
        origin_motion, tip_motion = SE3.exp(tangents[..., :-1, :]), SE3.exp(tangents[..., -1, :])
        return replace(self, origins=self.origins @ origin_motion, tip=self.tip @ tip_motion)

    def joint_frames(self, joints: Array) -> SE3:
        """Poses `base_from_joint` of the joints' own frames, which rotate with the joints, (n, ...).

        Args:
            joints: (..., n) joints of a single arm [rad].
        """
        posture = self.posture(joints)
        return posture.base_from_flange @ posture.joint_from_flange.inverse()


@dataclass(frozen=True, eq=False)
class ChainPosture:
    """Posture of an arm, or of a batch of arms, with derivatives of the flange pose.

    Attributes:
        axes: (n, 3) axes of the joints in their own frames.
        base_from_flange: (...) flange poses.
        joint_rotations: (n, ..., 3, 3) rotation of each joint about its axis.
        joint_from_flange: (n, ...) flange poses in the frames that rotate with the joints.
    """

    axes: Array
    base_from_flange: SE3
    joint_rotations: Array
    joint_from_flange: SE3

    @cached_property
    def joint_derivative(self) -> Array:
        """Derivative of `base_from_flange` with respect to the joints, (..., 6, n) [m/rad, rad/rad].

        Right tangents: `forward(q + d) == forward(q) @ SE3.exp(joint_derivative @ d)` to first order in d.
        Source: Lynch & Park 2017, "Modern Robotics", 5.1.4 (the body Jacobian).
        """
        axes = self.axes.reshape(len(self.axes), *[1] * len(self.base_from_flange.shape), 3)
        columns = np.empty((*self.joint_from_flange.shape, 3, 2))
        columns[..., 0], columns[..., 1] = np.cross(axes, self.joint_from_flange.translation), axes
        rotated = self.joint_from_flange.rotation.mT @ columns
        by_joint = np.concatenate([rotated[..., 0], rotated[..., 1]], -1)
        return np.ascontiguousarray(np.moveaxis(by_joint, 0, -1))

    @cached_property
    def link_derivative(self) -> Array:
        """Derivative of `base_from_flange` by right perturbations of each origin, last of the tip, (..., 6, 6 (n + 1)).

        Right tangents: `perturb_links(d).forward(q) == forward(q) @ SE3.exp(link_derivative @ d.ravel())` to first
        order in d.
        """
        joint_from_flange = self.joint_from_flange
        origin_from_flange = SE3.adopt(
            self.joint_rotations @ joint_from_flange.rotation,
            (self.joint_rotations @ joint_from_flange.translation[..., None])[..., 0],
        )
        blocks, batch = origin_from_flange.inverse().adjoint(), self.base_from_flange.shape
        with_tip = np.concatenate([blocks, np.broadcast_to(np.eye(6), (1, *batch, 6, 6))])
        return np.moveaxis(with_tip, 0, -2).reshape(*batch, 6, 6 * (len(self.axes) + 1))


@dataclass(frozen=True, eq=False)
class Masses(ReadOnlyArrays):
    """Masses rigidly attached to each of the n joints of a chain; the last includes the load of the flange.

    Attributes:
        kg: (n,) masses [kg].
        centres: (n, 3) centres of mass in the joints' own frames, which rotate with the joints [m].
        down: (3,) direction of gravity in the chain's base, of any length; -z by default.

    Raises:
        InputError: if a shape is wrong, a mass is negative, or `down` is zero.
    """

    kg: Array
    centres: Array
    down: Array = field(default_factory=lambda: np.array([0.0, 0.0, -1.0]))

    def __post_init__(self) -> None:
        object.__setattr__(self, "kg", read_only(self.kg, (None,), "kg"))
        object.__setattr__(self, "centres", read_only(self.centres, (len(self.kg), 3), "centres"))
        if np.any(self.kg < 0):
            raise InputError("masses are not negative")
        length = float(np.linalg.norm(self.down))
        if not length > 0:
            raise InputError("down is the direction of gravity in the base of the arm, not zero")
        object.__setattr__(self, "down", read_only(np.asarray(self.down) / length, (3,), "down"))
