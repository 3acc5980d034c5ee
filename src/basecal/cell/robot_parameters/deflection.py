"""Deflection: what each joint turns by under the torque of the links' weight about its axis [rad/Nm], (n,).

Torques are those of the chain as stated, at the joints as recorded. Source: docs/mathematics.md (9.1).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from pydantic import field_validator as checks

from basecal.cell.calibration import RobotParameters
from basecal.cell.format.parameters import Parameters
from basecal.cell.format.values import Sigma, Vector
from basecal.cell.robot_parameters.kind import Columns, Posture, joint_lines
from basecal.errors import InputError
from basecal.geometry import Array, read_only
from basecal.kinematics import SerialChain, gravity_torques

BY_JOINT = True
ONE = "the compliance"
SCALE = 0.01  # [rad/Nm]: 1 rad under 100 Nm
LARGEST_SIGMA = 3e-3  # [rad/Nm]


class Stated(Parameters):
    """What is known of the compliances: the sigma of each [rad/Nm], and where down is in the robot's base."""

    sigma_rad_per_nm: Sigma | None = None
    down: Vector | None = None

    @checks("down")
    @classmethod
    def _some_direction(cls, value: list[float] | None) -> list[float] | None:
        if value is not None and not any(value):
            raise ValueError("down is the direction of gravity in the robot's base, not zero")
        return value


def hung(chain: SerialChain, stated: Parameters | None) -> SerialChain:
    """The chain with gravity as it is stated, whether compliances are estimated or not; as it is where it is not."""
    if not isinstance(stated, Stated) or stated.down is None or chain.masses is None:
        return chain
    return replace(chain, masses=replace(chain.masses, down=np.array(stated.down)))


def zero(joints: int) -> Array:
    """See `RobotParameterKind`."""
    return np.zeros(joints)


def columns(chain: SerialChain, stated: Stated) -> Columns:
    """See `RobotParameterKind`."""
    if chain.masses is None:
        raise InputError("needs the masses of its links: give them an <inertial> in its urdf")
    sigma = None if stated.sigma_rad_per_nm is None else np.full(chain.n, stated.sigma_rad_per_nm)
    return Columns(np.eye(chain.n), sigma)


def shift(chain: SerialChain, stated: Stated, joints: Array, values: Array) -> Array:
    """See `RobotParameterKind`."""
    return (values[..., None, :] if values.ndim > 1 else values) * gravity_torques(hung(chain, stated), joints)


def moved(chain: SerialChain, values: Array) -> SerialChain:
    """See `RobotParameterKind`."""
    return chain


def derivative(at: Posture, stated: Stated, values: Array) -> Array:
    """See `RobotParameterKind`."""
    return at.true.by_joints * gravity_torques(hung(at.chain, stated), at.recorded)[..., None, :]


def unobserved(joints: str, rows: Sequence[int], count: int, base: str, by_prior: bool) -> str:
    """See `RobotParameterKind`."""
    how = "known from their prior alone" if by_prior else "that are unobservable"
    reason = "the torque of gravity about them is small in these samples, or the same in all of them"
    return f"compliances {how}: {joints}: {reason}"


def report(robot: str, found: RobotParameters) -> list[str]:
    """See `RobotParameterKind`."""
    lines = joint_lines(found, 1e6, "urad/Nm", 2)
    return [f"compliances of the joints of {robot} under the torque of gravity", *lines]


def to_dict(found: Mapping[str, RobotParameters]) -> dict[str, Any]:
    """See `RobotParameterKind`."""
    by_robot = {
        robot: {"rad_per_nm": of.values, "sigma_rad_per_nm": of.sigma, "seen": of.seen, "joint_names": of.joints}
        for robot, of in found.items()
    }
    return {"deflection": by_robot or None}


def from_dict(data: Mapping[str, Any]) -> dict[str, RobotParameters]:
    """See `RobotParameterKind`."""
    found = {}
    for robot, entry in (data.get("deflection") or {}).items():
        n = len(entry["joint_names"])
        values = read_only(entry["rad_per_nm"], (n,), "rad_per_nm")
        sigma = read_only(entry["sigma_rad_per_nm"], (n,), "sigma_rad_per_nm")
        found[robot] = RobotParameters(tuple(entry["joint_names"]), values, sigma, np.array(entry["seen"], dtype=bool))
    return found
