"""Robots with joints: a fictitious arm with six axes, its true kinematics, and its inverse kinematics.

The fictitious arm has a shoulder, two links of 0.42 and 0.39 m, and a wrist whose axes do not intersect.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from basecal.cell.cell import WORLD
from basecal.errors import InputError
from basecal.estimation.problem.robot_parameters import Kinematics
from basecal.geometry import SE3, Array, BoolArray
from basecal.geometry.se3_jacobians import right_jacobian_inverse
from basecal.kinematics import Masses, SerialChain
from basecal.simulation.draw import Generator
from basecal.simulation.scenario import Scenario
from basecal.simulation.scene import Scene, as_point

BASE_LINK, FLANGE_LINK = "base_link", "tool0"
_JOINT_NAMES = ("shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3")
_QUARTER_TURN_RAD = np.pi / 2
_JOINT_ORIGINS_M = ((0, 0, 0.16), (0, 0.05, 0), (-0.42, 0, 0), (-0.39, 0, 0.12), (0, -0.1, 0), (0, 0.095, 0))
_JOINT_ROTATIONS_RAD = (
    (0, 0, 0),
    (_QUARTER_TURN_RAD, 0, 0),
    (0, 0, 0),
    (0, 0, 0),
    (_QUARTER_TURN_RAD, 0, 0),
    (-_QUARTER_TURN_RAD, 0, 0),
)
_MASSES_KG = (4.0, 8.0, 3.0, 1.5, 1.5, 0.8)
_MASS_CENTRES_M = ((0, 0.02, 0), (-0.2, 0, 0.1), (-0.2, 0, 0.05), (0, -0.02, 0), (0, 0.02, 0), (0, 0, 0.05))
_HOME_RAD = (0.0, -1.2, 1.5, -1.8, 1.4, 0.0)  # bent elbow and wrist: no aligned axes
_HOME_SPREAD_RAD = (np.pi, 0.4, 0.4, 0.5, 0.5, np.pi)
_INVERSE_STEPS = 25
_LARGEST_STEP = 0.5  # [rad]
_DAMPING = 1e-6
_REACH_TOLERANCE = 1e-9


@dataclass(frozen=True, eq=False)
class Arm:
    """A robot with joints.

    Attributes:
        chain: Stated kinematics.
        true: True kinematics.
        home: (n,) joints at the home pose [rad].
    """

    chain: SerialChain
    true: Kinematics
    home: Array


def six_axis() -> SerialChain:
    """Kinematic chain of the fictitious arm."""
    tip = SE3.from_rpy((0, 0, 0), (0, 0, 0.09))
    masses = Masses(np.array(_MASSES_KG), np.array(_MASS_CENTRES_M))
    return elbow_arm(_JOINT_ORIGINS_M, tip, np.full(6, 2 * np.pi), masses)


def elbow_arm(
    joint_origins_m: Sequence[tuple[float, float, float]], tip: SE3, limits_rad: Array, masses: Masses
) -> SerialChain:
    """Kinematic chain of an arm with six axes: shoulder, elbow and wrist, in the design of Universal Robots' arms.

    Args:
        joint_origins_m: Origin of each joint in the frame of the previous joint [m].
        tip: Pose of the flange in the frame of the last joint.
        limits_rad: (6,) symmetric limits of the joints.
        masses: Masses of the links.
    """
    joints = zip(_JOINT_ROTATIONS_RAD, joint_origins_m, strict=True)
    origins = SE3.stack([SE3.from_rpy(turn, place) for turn, place in joints])
    axes = np.tile([0.0, 0.0, 1.0], (6, 1))
    return SerialChain(_JOINT_NAMES, origins, axes, tip, -limits_rad, limits_rad, masses)


def with_arms(scene: Scene, scenario: Scenario, rng: Generator) -> tuple[Scene, dict[str, Arm]]:
    """Draw arms, and move the bases so that the arms reach the homes; the new scene, and the arms.

    Flanges, cameras and targets keep their relative poses, so that the views at the homes do not change.

    Raises:
        InputError: if a robot has several homes.
    """
    if len(scene.homes) != 1:
        raise InputError(
            f"layout {scenario.layout!r} has robots with several homes: simulate joints of one or two robots"
        )
    homes, bases, arms = dict(scene.homes[0]), dict(scene.bases), {}
    for robot in scene.layout.robots:
        arms[robot] = _arm(scenario, rng)
        home = arms[robot].chain.forward(arms[robot].home)
        if robot in homes:
            bases[robot] = bases[robot] @ homes[robot] @ home.inverse()
        homes[robot] = home
    new_from_old = bases[scene.layout.robots[0]].inverse()
    carried = {**scene.layout.cameras, **scene.layout.targets}
    mounts = dict(scene.mounts)
    for name in [name for name in mounts if carried[name] == WORLD]:
        mount, target = new_from_old @ mounts[name], scene.shapes.get(name)
        mounts[name] = as_point(mount, target) if target is not None and target.is_point else mount
    new_bases = {robot: new_from_old @ base for robot, base in bases.items()}
    new_bases[scene.layout.robots[0]] = SE3.identity()
    return replace(scene, bases=new_bases, mounts=mounts, homes=(homes,)), arms


def _arm(scenario: Scenario, rng: Generator) -> Arm:
    chain = six_axis()
    home = np.array(_HOME_RAD) + np.array(_HOME_SPREAD_RAD) * rng.uniform(-1, 1, chain.n)
    offsets = scenario.joint_offset_rad * rng.standard_normal(chain.n)
    links = rng.standard_normal((chain.n + 1, 6)) * np.repeat(scenario.link_error, 3)
    compliance = scenario.compliance * rng.standard_normal(chain.n)
    values = {"joint_offsets": offsets, "link_parameters": links}
    if scenario.compliance:
        values["deflection"] = compliance
    return Arm(chain, Kinematics(chain, values), home)


def solve_joints(chain: SerialChain, base_from_flange: SE3, start: Array) -> tuple[Array, BoolArray]:
    """Solve the inverse kinematics; joints, (m, n) [rad], and which of them reach their pose, (m,).

    Args:
        chain: Kinematic chain of the arm.
        base_from_flange: (m,) goals of the flange.
        start: (n,) or (m, n) joints from which the iterations start.
    """
    q = np.array(np.broadcast_to(start, (len(base_from_flange), chain.n)))
    for _ in range(_INVERSE_STEPS):
        posture = chain.posture(q)
        remaining = (posture.base_from_flange.inverse() @ base_from_flange).log()
        jacobian = right_jacobian_inverse(-remaining) @ posture.joint_derivative
        transposed = jacobian.mT
        normal = transposed @ jacobian + _DAMPING * np.eye(chain.n)
        step = np.linalg.solve(normal, transposed @ remaining[..., None])[..., 0]
        q += step * np.minimum(1.0, _LARGEST_STEP / np.maximum(np.abs(step).max(-1, keepdims=True), 1e-12))
    remaining = (chain.forward(q).inverse() @ base_from_flange).log()
    inside = np.all((q >= chain.lower) & (q <= chain.upper), axis=-1)
    return q, (np.abs(remaining).max(-1) < _REACH_TOLERANCE) & inside
