"""Joint offsets: what is to be added to each recorded joint [rad], (n,).

Up to the first joint that moved they turn the arm as its base does; the last one turns what the flange carries as the
mounts do. Where these are free, a free offset there is held at zero, which defines the other.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from basecal.cell.calibration import RobotParameters
from basecal.cell.format.parameters import Parameters
from basecal.cell.format.values import Sigma
from basecal.cell.robot_parameters.kind import Columns, Posture, joint_lines
from basecal.geometry import Array, read_only
from basecal.kinematics import SerialChain

BY_JOINT = True
ONE = "the offset"
SCALE = 1.0
LARGEST_SIGMA = 0.3  # [rad]
_KEYS = (
    "joint_offsets_rad",
    "joint_offsets_sigma_rad",
    "joint_offsets_covariance",
    "joint_offsets_seen",
    "joint_names",
)


class Stated(Parameters):
    """What is known of the offsets: the sigma of each [rad]."""

    sigma_rad: Sigma | None = None


def zero(joints: int) -> Array:
    """See `RobotParameterKind`."""
    return np.zeros(joints)


def columns(chain: SerialChain, stated: Stated) -> Columns:
    """See `RobotParameterKind`."""
    sigma = None if stated.sigma_rad is None else np.full(chain.n, stated.sigma_rad)
    return Columns(np.eye(chain.n), sigma)


def shift(chain: SerialChain, stated: Parameters, joints: Array, values: Array) -> Array:
    """See `RobotParameterKind`."""
    return values[..., None, :] if values.ndim > 1 else values


def moved(chain: SerialChain, values: Array) -> SerialChain:
    """See `RobotParameterKind`."""
    return chain


def derivative(at: Posture, stated: Parameters, values: Array) -> Array:
    """See `RobotParameterKind`."""
    return at.true.by_joints


def unobserved(joints: str, rows: Sequence[int], count: int, base: str, by_prior: bool) -> str:
    """See `RobotParameterKind`."""
    still = next((row for row in range(count) if row not in rows), 0)  # of the first joints, as many as the base
    ends = {0: "the first joint moves the arm as its base does"}
    if still > 1:
        ends[0] = f"joints 1 to {still} move the arm as its base does, in these samples"
    ends[count - 1] = "the last one as the mounts on its flange do"
    reasons = [ends[row] for row in rows if row in ends]
    if any(row >= still and row not in ends for row in rows):
        reasons.append("the samples hardly move the others by themselves")
    why = f"{joints}: {', '.join(reasons)}"
    if by_prior:
        rest = f"the sigmas of {base} and of the mounts contain what they leave open"
        return f"offsets known from their prior alone: {why}; {rest}"
    return f"offsets that are unobservable and fixed at zero as a gauge: {why}; {base} and the mounts make up for them"


def report(robot: str, found: RobotParameters) -> list[str]:
    """See `RobotParameterKind`."""
    lines = joint_lines(found, float(np.degrees(1)), "deg", 4)
    return [f"joint offsets of {robot}, to be added to its recorded joints", *lines]


def to_dict(found: Mapping[str, RobotParameters]) -> dict[str, Any]:
    """See `RobotParameterKind`."""
    if not found:
        return dict.fromkeys(_KEYS)
    rows = {robot: (of.values, of.sigma, of.covariance, of.seen, of.joints) for robot, of in found.items()}
    return {key: {robot: row[k] for robot, row in rows.items()} for k, key in enumerate(_KEYS)}


def from_dict(data: Mapping[str, Any]) -> dict[str, RobotParameters]:
    """See `RobotParameterKind`."""
    values, _, covariances, seen, names = (data.get(key) or {} for key in _KEYS)
    found = {}
    for robot in values:
        n = len(names[robot])
        covariance = read_only(covariances[robot], (n, n), "joint_offsets_covariance")
        rad, known = read_only(values[robot], (n,), "joint_offsets_rad"), np.array(seen[robot], dtype=bool)
        found[robot] = RobotParameters(tuple(names[robot]), rad, np.sqrt(np.diag(covariance)), known, covariance)
    return found
