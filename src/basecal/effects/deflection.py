"""Deflection: compliance of each joint under the torque of the links' weight about its axis [rad/Nm], (n,).

Torques are computed for the stated chain at the recorded joints. Source: docs/mathematics.md (9.1).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import partial

import numpy as np
from pydantic import field_validator as checks

from basecal.effects.faces.candidates import Candidates, Views, one_candidate
from basecal.effects.faces.effect import (
    AGAIN,
    DEGREE,
    Effect,
    FoundEffect,
    RandomEffect,
    SimulatedFault,
    Words,
    format_length,
)
from basecal.effects.faces.robot_parameter import (
    Columns,
    Posture,
    RobotParameter,
    RobotParameters,
    Unobserved,
    from_dict,
    joint_columns,
    joint_lines,
    moves_by_joint,
    to_dict,
    unestimated_chains,
)
from basecal.effects.faces.shared_errors import KINEMATICS, SharedErrors
from basecal.errors import InputError
from basecal.fields.digits import two_digits
from basecal.fields.parameters import Parameters
from basecal.fields.values import Sigma, Vector
from basecal.geometry import Array
from basecal.kinematics import SerialChain, gravity_torques

NAME = "deflection"
PER_NM = "rad/Nm"  # unit of a compliance
_KEYS = "rad_per_nm", "sigma_rad_per_nm"
_EQUAL_SHARE = 0.7  # share of the variance of compliances that is equal for all joints of an arm
_SIMULATED_NM = 50.0  # typical torque at the shoulder of an arm of one metre


class Stated(Parameters):
    """Prior knowledge of the compliances: the sigma of each [rad/Nm], and the direction of gravity in the base."""

    sigma_rad_per_nm: Sigma | None = None
    down: Vector | None = None

    @checks("down")
    @classmethod
    def _check_direction(cls, value: list[float] | None) -> list[float] | None:
        if value is not None and not any(value):
            raise ValueError("down is the direction of gravity in the robot's base, not zero")
        return value


def apply_gravity(chain: SerialChain, statement: Parameters | None) -> SerialChain:
    """The chain with the stated direction of gravity; unchanged if none is stated or the links have no masses."""
    if not isinstance(statement, Stated) or statement.down is None or chain.masses is None:
        return chain
    return replace(chain, masses=replace(chain.masses, down=np.array(statement.down)))


def columns(chain: SerialChain, statement: Stated) -> Columns:
    """A column for each joint."""
    if chain.masses is None:
        raise InputError("needs the masses of its links: give them an <inertial> in its urdf")
    return joint_columns(chain, statement.sigma_rad_per_nm)


def torques(chain: SerialChain, statement: Parameters, joints: Array) -> Array:
    """Torque of gravity about each joint [Nm]: its rotation by a compliance of 1 rad/Nm."""
    return gravity_torques(apply_gravity(chain, statement), joints)


def unobserved_reason(case: Unobserved) -> str:
    """Explain why the data do not determine the compliances of some joints."""
    how = "known from their prior alone" if case.by_prior else "that are unobservable"
    reason = "the torque of gravity about them is small in these samples, or the same in all of them"
    return f"compliances {how}: {case.joints}: {reason}"


def report(robot: str, effect: RobotParameters) -> list[str]:
    """A heading, and a line for each joint."""
    lines = joint_lines(effect, 1e6, "urad/Nm", 2)
    return [f"compliances of the joints of {robot} under the torque of gravity", *lines]


def entry(values: Array) -> str:
    """The entry of cell.yaml that estimates the compliances."""
    return "`deflection: {status: free}`"


def shared_errors(posture: Posture) -> SharedErrors | None:
    """Errors of joints that yield in proportion to their torques; their compliances are mostly equal.

    The sigma of rotations is that of the joint with the largest torque, as root mean square over the stops.
    """
    if posture.chain.masses is None:
        return None
    torques_nm = gravity_torques(posture.chain, posture.recorded)
    largest_nm = float(np.sqrt(np.mean(torques_nm**2, axis=0)).max())
    if not largest_nm > 0:
        return None
    by_joint = posture.true.joint_derivative * (torques_nm / largest_nm)[:, None, :]
    equal, own = np.sqrt(_EQUAL_SHARE) * by_joint.sum(-1, keepdims=True), np.sqrt(1 - _EQUAL_SHARE) * by_joint
    return SharedErrors(np.concatenate([equal, own], axis=-1), np.ones(posture.chain.n + 1, dtype=bool))


def likely(sigmas: Mapping[str, Array]) -> Words:
    """Describe compliances that the estimated noise indicates."""
    robots, turn = " and ".join(sigmas), max(float(turn) for _, turn in sigmas.values())
    angle = two_digits(np.degrees(turn))
    what = f"Joints of {robots} likely yield to the weight of the links by {angle} deg (1 sigma)."
    return Words("deflection", what, (f"To estimate it, write {entry(np.zeros(0))} at {robots}.",))


def candidates(views: Views) -> Iterator[Candidates]:
    """Candidates: each robot with known joints and masses, with rotations of compliance x torque [rad/Nm].

    One candidate has a single compliance for all joints, another one for each joint.
    """
    for robot, chain in unestimated_chains(views, NAME):
        if chain.masses is None:
            continue
        each = moves_by_joint(views, robot, chain, gravity_torques)
        yield one_candidate(NAME, robot, PER_NM, tuple(None if m is None else m.sum(-1, keepdims=True) for m in each))
        yield one_candidate(NAME, robot, PER_NM, each)


def words(effect: FoundEffect) -> Words:
    """Describe the root mean square of the compliances of the joints."""
    compliance = format_length(effect.size, effect.covariance, 1e6 * len(effect.size) ** -0.5)
    what = f"Joints of {effect.about} yield by {compliance} urad per Nm of the torque of the links' weight."
    return Words("deflection", what, (f"Write {entry(effect.size)} at {effect.about} in cell.yaml.", AGAIN))


def draw_fault(size: float, joints: int, rng: np.random.Generator) -> Array:
    """Compliances between 0.5 and 1.5 times the one that turns a joint by `size` [rad] under 50 Nm, [rad/Nm]."""
    return np.asarray(size / _SIMULATED_NM * (0.5 + rng.random(joints)))


EFFECT = Effect(
    NAME,
    parameter=RobotParameter(
        Stated,
        "the compliance",
        columns,
        report,
        partial(to_dict, NAME, _KEYS),
        partial(from_dict, NAME, _KEYS),
        entry,
        turn=torques,
        scale=0.01,  # [rad/Nm]: 1 rad under 100 Nm
        largest_sigma=3e-3,  # [rad/Nm]
        unobserved=unobserved_reason,
    ),
    random=RandomEffect(
        KINEMATICS,
        "sag of its joints under the links' weight",
        by_joints=shared_errors,
        likely=likely,
        replaced_by=(NAME,),
    ),
    candidates=candidates,
    words=words,
    fault=SimulatedFault(
        "sag", "deg", DEGREE, 0.1, "each joint yields by about this angle under a load of 50 Nm", draw=draw_fault
    ),
)
