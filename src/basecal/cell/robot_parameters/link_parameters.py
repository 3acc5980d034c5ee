"""Link parameters: right tangents of the origins of a chain's joints, last of its tip [m, rad], (n + 1, 6)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from basecal.cell.calibration import RobotParameters
from basecal.cell.format.parameters import Parameters
from basecal.cell.format.values import Sigma
from basecal.cell.robot_parameters.kind import Columns, Posture
from basecal.geometry import Array, read_only
from basecal.geometry.se3_jacobians import right_jacobian
from basecal.kinematics import SerialChain

BY_JOINT = False
ONE = "an error of the links"
SCALE = 1.0
LARGEST_SIGMA = np.inf
_METRES_PER_RADIAN = 0.5  # of link errors that explain the data alike, the smallest counts so


class Stated(Parameters):
    """What is known of the links: the sigmas of each turn [rad] and shift [m]."""

    sigma_rad: Sigma | None = None
    sigma_m: Sigma | None = None


def zero(joints: int) -> Array:
    """See `RobotParameterKind`."""
    return np.zeros((joints + 1, 6))


def columns(chain: SerialChain, stated: Stated) -> Columns:
    """See `RobotParameterKind`."""
    if stated.sigma_m is not None and stated.sigma_rad is not None:
        per_axis = np.repeat([stated.sigma_m, stated.sigma_rad], 3)
        return Columns(np.eye(6 * (chain.n + 1)), np.tile(per_axis, chain.n + 1))
    return Columns(np.diag(np.tile(np.repeat([_METRES_PER_RADIAN, 1.0], 3), chain.n + 1)), None)


def shift(chain: SerialChain, stated: Parameters, joints: Array, values: Array) -> float:
    """See `RobotParameterKind`."""
    return 0.0


def moved(chain: SerialChain, values: Array) -> SerialChain:
    """See `RobotParameterKind`."""
    return chain.moved(values) if np.any(values) else chain


def derivative(at: Posture, stated: Parameters, values: Array) -> Array:
    """See `RobotParameterKind`."""
    links = at.true.by_links
    by_link = np.swapaxes(links.reshape(*links.shape[:-1], -1, 6), -2, -3)
    turned = by_link @ right_jacobian(values)[..., None, :, :, :]
    return np.asarray(np.swapaxes(turned, -2, -3).reshape(links.shape))


def unobserved(joints: str, rows: Sequence[int], count: int, base: str, by_prior: bool) -> str:
    """See `RobotParameterKind`; what is not joint by joint is left out where it is not seen."""
    return f"links that are unobservable: {joints}"


def report(robot: str, found: RobotParameters) -> list[str]:
    """See `RobotParameterKind`."""
    lines = [f"link errors of {robot}, right tangents of each joint's origin, then of the tip"]
    for k, tangent in enumerate(found.values, 1):
        shown = [f"{round(float(value), 4) + 0.0:10.4f}" for value in (*tangent[:3] * 1e3, *np.degrees(tangent[3:]))]
        lines.append(f"  {k:<3}t {''.join(shown[:3])} mm   r {''.join(shown[3:])} deg")
    return lines


def to_dict(found: Mapping[str, RobotParameters]) -> dict[str, Any]:
    """See `RobotParameterKind`."""
    by_robot = {}
    for robot, of in found.items():
        halves = {"t_m": of.values[:, :3], "r_rad": of.values[:, 3:]}
        by_robot[robot] = {**halves, "sigma_t_m": of.sigma[:, :3], "sigma_r_rad": of.sigma[:, 3:]}
    return {"link_parameters": by_robot or None}


def from_dict(data: Mapping[str, Any]) -> dict[str, RobotParameters]:
    """See `RobotParameterKind`."""
    found = {}
    for robot, entry in (data.get("link_parameters") or {}).items():
        values, sigma = (
            np.concatenate([read_only(entry[f"{of}{key}"], (None, 3), f"{of}{key}") for key in ("t_m", "r_rad")], -1)
            for of in ("", "sigma_")
        )
        found[robot] = RobotParameters((), values, sigma, np.ones(values.shape, dtype=bool))
    return found
