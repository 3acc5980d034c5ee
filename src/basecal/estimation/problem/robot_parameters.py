"""What is estimated of a robot's own kinematics: offsets of its joints, errors of its links, how gravity bends it.

A robot given by joints stands where its chain with moved links stands at the recorded joints with their offsets, each
turned besides by its compliance times the torque of gravity. Two ends of an arm cannot be told from what they hang on:
the first joint's offset turns the arm as its base does, the last one's as the mounts on its flange do. Where both sides
of such a pair are free, the arm's side is held at zero, which defines the other.
Source: docs/mathematics.md (9.1).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from basecal.cell import Deflection, Parameters
from basecal.errors import InputError
from basecal.geometry import SE3, Array, IntArray
from basecal.geometry.se3 import right_jacobian
from basecal.kinematics import SerialChain, gravity_torques
from basecal.numerics.spectral import independent

OFFSETS, LINKS, DEFLECTION = "joint_offsets", "link_parameters", "deflection"
_METRES_PER_RADIAN = 0.5  # of link errors that explain the data alike, the smallest counts so
_RIGID = Deflection()


@dataclass(frozen=True, eq=False)
class RobotModel:
    """The columns of one robot's kinematics.

    Attributes:
        robot: Its name.
        chain: Its kinematics as stated, of n joints.
        joints: (m,) which joints have an offset to estimate.
        offset_sigma: Of the offsets' prior about zero [rad]; None where they are free.
        link_basis: (6 (n + 1), k) tangents of the origins, then of the tip [m, rad], by column.
        link_sigma: (k,) of the columns' prior about zero; None where they are free.
        elastic: (e,) which joints have a compliance to estimate.
        compliance_sigma: Of the compliances' prior about zero [rad/Nm]; None where they are free.
        down: (3,) unit vector along gravity in the base; None without compliances.
    """

    robot: str
    chain: SerialChain
    joints: IntArray
    offset_sigma: float | None
    link_basis: Array
    link_sigma: Array | None
    elastic: IntArray = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    compliance_sigma: float | None = None
    down: Array | None = None

    @property
    def widths(self) -> dict[str, int]:
        """How many columns there are of each kind that has any, by name."""
        counts = {OFFSETS: len(self.joints), LINKS: self.link_basis.shape[1], DEFLECTION: len(self.elastic)}
        return {f"{self.robot}_{kind}": count for kind, count in counts.items() if count}

    @property
    def sigmas(self) -> dict[str, Array | None]:
        """Sigmas of the prior of each kind's columns, by name; None where they are free."""
        offset = None if self.offset_sigma is None else np.full(len(self.joints), self.offset_sigma)
        bend = None if self.compliance_sigma is None else np.full(len(self.elastic), self.compliance_sigma)
        kinds = {OFFSETS: offset, LINKS: self.link_sigma, DEFLECTION: bend}
        return {name: kinds[name.removeprefix(f"{self.robot}_")] for name in self.widths}


@dataclass(frozen=True, eq=False)
class Kinematics:
    """A value of a robot's kinematics.

    Attributes:
        chain: As stated.
        offsets: (n,) what is added to each recorded joint [rad].
        links: (n + 1, 6) right tangents of the origins, then of the tip [m, rad].
        compliance: (n,) what each joint turns by under a torque [rad/Nm].
        down: (3,) unit vector along gravity in the base; None where joints do not give way.
    """

    chain: SerialChain
    offsets: Array
    links: Array
    compliance: Array = field(default_factory=lambda: np.zeros(0))
    down: Array | None = None

    @cached_property
    def moved(self) -> SerialChain:
        """The chain with its links moved; offsets are not in it."""
        return self.chain.moved(self.links) if np.any(self.links) else self.chain

    def forward(self, joints: Array) -> SE3:
        """`base_from_flange`, (...), at recorded joints (..., n) [rad]."""
        return self.moved.forward(self.true_joints(joints))

    def true_joints(self, joints: Array) -> Array:
        """Where recorded joints (..., n) truly stand [rad]; torques are those of the chain as stated, as recorded."""
        true: Array = joints + self.offsets
        return true if self.down is None else true + self.compliance * gravity_torques(self.chain, joints, self.down)


def nominal(chain: SerialChain, down: Array | None = None) -> Kinematics:
    """The kinematics as stated."""
    return Kinematics(chain, np.zeros(chain.n), np.zeros((chain.n + 1, 6)), np.zeros(chain.n), down)


def robot_model(
    robot: str,
    chain: SerialChain,
    offsets: Parameters,
    links: Parameters,
    free_ends: tuple[bool, bool] = (False, False),
    joints: IntArray | None = None,
    deflection: Deflection = _RIGID,
) -> RobotModel:
    """The columns of what is not fixed.

    Args:
        robot: Its name.
        chain: Its kinematics as stated.
        offsets: What is known of the joint offsets.
        links: What is known of the link parameters.
        free_ends: Whether its base, and whether all that its flange carries, are free.
        joints: Which joints may be off; all where None.
        deflection: What is known of how the joints give way to gravity.

    Raises:
        InputError: if a prior lacks its sigma, or the chain of a robot that gives way its masses.
    """
    n = chain.n
    chosen = np.arange(n) if joints is None else joints
    if offsets.status == "fixed":
        chosen = chosen[:0]
    if offsets.status == "free":
        first, last = free_ends
        chosen = chosen[~((first & (chosen == 0)) | (last & (chosen == n - 1)))]
    sigma = _stated(offsets.sigma_rad, robot, OFFSETS) if offsets.status == "prior" else None
    basis, link_sigma = np.zeros((6 * (n + 1), 0)), None
    if links.status == "prior":
        per_axis = np.repeat([_stated(links.sigma_m, robot, LINKS), _stated(links.sigma_rad, robot, LINKS)], 3)
        basis, link_sigma = np.eye(6 * (n + 1)), np.tile(per_axis, n + 1)
    elif links.status == "free":
        basis = _without_gauge(chain, free_ends, offsets.status != "fixed")
    model = RobotModel(robot, chain, chosen.astype(np.int64), sigma, basis, link_sigma)
    return model if deflection.status == "fixed" else _with_deflection(model, deflection)


def _with_deflection(model: RobotModel, deflection: Deflection) -> RobotModel:
    if model.chain.masses is None:
        raise InputError(
            f"robot {model.robot!r}: deflection needs the masses of its links: give them an <inertial> in its urdf"
        )
    elastic, sigma = np.arange(model.chain.n, dtype=np.int64), None
    if deflection.status == "prior":
        sigma = _stated(deflection.sigma_rad_per_nm, model.robot, DEFLECTION)
    return replace(model, elastic=elastic, compliance_sigma=sigma, down=downwards(deflection))


def downwards(deflection: Deflection) -> Array:
    """Unit vector along gravity in the robot's base, (3,)."""
    return np.asarray(np.array(deflection.down) / np.linalg.norm(deflection.down))


def _stated(sigma: float | None, robot: str, what: str) -> float:
    if sigma is None:
        raise InputError(f"robot {robot!r}: {what} with status prior need their sigmas")
    return sigma


def link_gauges(chain: SerialChain, free_ends: tuple[bool, bool], with_offsets: bool) -> Array:
    """Link tangents that move nothing, or no more than something else that is free, (6 (n + 1), g).

    A turn about a joint's own axis and a shift along it pass through the joint: before it they are the same as after
    it. A free base takes up any movement of the first origin, free mounts any of the tip, offsets turns about axes.

    Args:
        chain: The arm.
        free_ends: Whether its base, and whether all that its flange carries, are free.
        with_offsets: Whether its joint offsets are estimated too.
    """
    n = chain.n
    origins = [chain.origins[i] for i in range(1, n)]
    after = SE3.stack([*origins, chain.tip]).inverse().adjoint()
    gauges = []
    for i, axis in enumerate(chain.axes):
        along = np.zeros((6, 2))
        along[:3, 0] = along[3:, 1] = axis
        passed = np.zeros((6 * (n + 1), 2))
        passed[6 * i : 6 * i + 6], passed[6 * i + 6 : 6 * i + 12] = along, -after[i] @ along
        gauges.append(passed)
        if with_offsets:
            turned = np.zeros((6 * (n + 1), 1))
            turned[6 * i : 6 * i + 6, 0] = along[:, 1]
            gauges.append(turned)
    for place, is_free in zip((slice(0, 6), slice(6 * n, 6 * n + 6)), free_ends, strict=True):
        if is_free:
            gauges.append(np.eye(6 * (n + 1))[:, place])
    return np.concatenate(gauges, -1)


def _without_gauge(chain: SerialChain, free_ends: tuple[bool, bool], with_offsets: bool) -> Array:
    """Columns that span all link tangents but the gauges, and are the smallest of those that do the same."""
    scale = np.tile(np.repeat([_METRES_PER_RADIAN, 1.0], 3), chain.n + 1)
    left, values, _ = np.linalg.svd(link_gauges(chain, free_ends, with_offsets) / scale[:, None])
    rank = independent(values)
    return np.asarray(scale[:, None] * left[:, rank:])


def by_columns(model: RobotModel, kinematics: Kinematics, joints: Array) -> Array:
    """Derivative of `base_from_flange` to the offsets, links and compliances, (n, 6, m + k + e), right tangents.

    Args:
        model: The columns.
        kinematics: Where.
        joints: (n, joints) as recorded [rad].
    """
    q = kinematics.true_joints(joints)
    by_joints = kinematics.moved.jacobian(q)
    parts = [by_joints[..., model.joints]]
    if model.link_basis.shape[1]:
        blocks = kinematics.moved.link_jacobian(q).reshape(len(q), 6, -1, 6)
        turned = np.einsum("nilj,ljk->nilk", blocks, right_jacobian(kinematics.links)).reshape(len(q), 6, -1)
        parts.append(turned @ model.link_basis)
    if len(model.elastic) and model.down is not None:
        torques = gravity_torques(model.chain, joints, model.down)
        parts.append((by_joints * torques[:, None])[..., model.elastic])
    return np.concatenate(parts, -1)


def after_step(model: RobotModel, kinematics: Kinematics, step: Mapping[str, Array]) -> Kinematics:
    """The kinematics after steps of the columns, by their names."""
    offsets, links = kinematics.offsets.copy(), kinematics.links
    if (name := f"{model.robot}_{OFFSETS}") in step:
        offsets[model.joints] += step[name]
    if (name := f"{model.robot}_{LINKS}") in step:
        links = links + (model.link_basis @ step[name]).reshape(links.shape)
    compliance = kinematics.compliance.copy()
    if (name := f"{model.robot}_{DEFLECTION}") in step:
        compliance[model.elastic] += step[name]
    return replace(kinematics, offsets=offsets, links=links, compliance=compliance)


def column_values(model: RobotModel, kinematics: Kinematics) -> dict[str, Array]:
    """What the columns with a prior are at, by name."""
    values = {f"{model.robot}_{OFFSETS}": kinematics.offsets[model.joints]}
    if model.link_sigma is not None:
        values[f"{model.robot}_{LINKS}"] = kinematics.links.ravel()
    values[f"{model.robot}_{DEFLECTION}"] = kinematics.compliance[model.elastic]
    return values
