"""Link parameters: right tangents of the origins of a chain's joints and of its tip [m, rad], (n + 1, 6)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from basecal.effects.faces.effect import MILLI, Effect, RandomEffect, SimulatedFault, Words
from basecal.effects.faces.robot_parameter import Columns, Posture, RobotParameter, RobotParameters
from basecal.effects.faces.shared_errors import KINEMATICS, SharedErrors
from basecal.fields.digits import two_digits
from basecal.fields.parameters import Parameters
from basecal.fields.values import Sigma
from basecal.geometry import Array, read_only
from basecal.geometry.se3_jacobians import right_jacobian
from basecal.kinematics import SerialChain

NAME = "link_parameters"
SIGMA_M, SIGMA_RAD = 1e-3, 2e-3  # of a prior: wider than manufacturing tolerances of arms
_METRES_PER_RADIAN = 0.5  # weight in the norm that selects the smallest of equivalent link errors
_TURN_PER_METRE = 1.0  # rotation over translation of a simulated link error [rad/m]


class Stated(Parameters):
    """Prior knowledge of the links: the sigmas of rotations [rad] and translations [m], per axis."""

    sigma_rad: Sigma | None = None
    sigma_m: Sigma | None = None


def zero(joints: int) -> Array:
    """Link parameters of the stated robot, all zero, (joints + 1, 6)."""
    return np.zeros((joints + 1, 6))


def columns(chain: SerialChain, statement: Stated) -> Columns:
    """A column for each parameter, with its prior sigma if both sigmas are stated."""
    if statement.sigma_m is not None and statement.sigma_rad is not None:
        per_axis = np.repeat([statement.sigma_m, statement.sigma_rad], 3)
        return Columns(np.eye(6 * (chain.n + 1)), np.tile(per_axis, chain.n + 1))
    return Columns(np.diag(np.tile(np.repeat([_METRES_PER_RADIAN, 1.0], 3), chain.n + 1)), None)


def move_links(chain: SerialChain, values: Array) -> SerialChain:
    """The chain with its origins perturbed."""
    return chain.perturb_links(values) if np.any(values) else chain


def derivative(posture: Posture, values: Array) -> Array:
    """Derivative of `base_from_flange` with respect to each origin's tangent."""
    links = posture.true.link_derivative
    by_link = np.swapaxes(links.reshape(*links.shape[:-1], -1, 6), -2, -3)
    turned = by_link @ right_jacobian(values)[..., None, :, :, :]
    return np.asarray(np.swapaxes(turned, -2, -3).reshape(links.shape))


def report(robot: str, effect: RobotParameters) -> list[str]:
    """A heading, and a line for each origin and the tip."""
    lines = [f"link errors of {robot}, right tangents of each joint's origin, then of the tip"]
    for k, tangent in enumerate(effect.values, 1):
        texts = [f"{round(float(value), 4) + 0.0:10.4f}" for value in (*tangent[:3] * 1e3, *np.degrees(tangent[3:]))]
        lines.append(f"  {k:<3}t {''.join(texts[:3])} mm   r {''.join(texts[3:])} deg")
    return lines


def to_dict(effect: Mapping[str, RobotParameters]) -> dict[str, Any]:
    """The field of `calibration.json`."""
    by_robot = {}
    for robot, each in effect.items():
        halves = {"t_m": each.values[:, :3], "r_rad": each.values[:, 3:]}
        by_robot[robot] = {**halves, "sigma_t_m": each.sigma[:, :3], "sigma_r_rad": each.sigma[:, 3:]}
    return {"link_parameters": by_robot or None}


def from_dict(data: Mapping[str, Any]) -> dict[str, RobotParameters]:
    """Read the field of `calibration.json` into the link parameters of each robot."""
    found = {}
    for robot, entry in (data.get("link_parameters") or {}).items():
        values, sigma = (
            np.concatenate([read_only(entry[prefix + key], (None, 3), prefix + key) for key in ("t_m", "r_rad")], -1)
            for prefix in ("", "sigma_")
        )
        found[robot] = RobotParameters((), values, sigma, np.ones(values.shape, dtype=bool))
    return found


def entry(values: Array) -> str:
    """The entry of cell.yaml that estimates the link parameters."""
    return f"`link_parameters: {{status: prior, sigma_rad: {SIGMA_RAD}, sigma_m: {SIGMA_M}}}`"


def shared_errors(posture: Posture) -> SharedErrors:
    """Errors of translation and rotation of each origin and of the tip."""
    return SharedErrors(posture.true.link_derivative, np.tile(np.repeat([False, True], 3), posture.chain.n + 1))


def likely(sigmas: Mapping[str, Array]) -> Words:
    """Describe link errors that the estimated noise indicates."""
    robots, (shift, turn) = " and ".join(sigmas), np.max(list(sigmas.values()), axis=0)
    size = f"{two_digits(1e3 * shift)} mm and {two_digits(np.degrees(turn))} deg (1 sigma)"
    do = f"To estimate them, write {entry(np.zeros(0))} at {robots}."
    return Words("robot-model", f"Links of {robots} likely differ from the URDF by {size}.", (do,))


def draw_fault(size: float, joints: int, rng: np.random.Generator) -> Array:
    """Random link errors with a sigma of `size` per axis [m], and of 1 mrad per millimetre of it for rotations."""
    return np.repeat([size, size * _TURN_PER_METRE], 3) * rng.standard_normal((joints + 1, 6))


EFFECT = Effect(
    NAME,
    parameter=RobotParameter(
        Stated,
        "an error of the links",
        columns,
        report,
        to_dict,
        from_dict,
        entry,
        zero=zero,
        move_chain=move_links,
        chain_derivative=derivative,
        is_by_joint=False,
    ),
    random=RandomEffect(
        KINEMATICS,
        "of its links",
        by_joints=shared_errors,
        likely=likely,
        is_certain=True,
        is_mapped=True,
        replaced_by=(NAME,),
    ),
    fault=SimulatedFault(
        "link-errors",
        "mm",
        MILLI,
        0.5,
        "each link is off, one sigma per axis, and turned by 1 mrad a mm",
        draw=draw_fault,
    ),
    absent={"candidate": "42 numbers of six joints: cross-validation chooses them, and their sigma shows them"},
)
