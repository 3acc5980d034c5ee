"""An effect as parameters of a robot that is recorded by joints: as cell.yaml states them and as they are estimated."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from basecal.fields.parameters import Parameters
from basecal.geometry import Array, BoolArray
from basecal.kinematics import ChainPosture, SerialChain


@dataclass(frozen=True, eq=False)
class RobotParameters:
    """Estimates of the parameters of one kind of one robot.

    Attributes:
        joints: Names of its joints, from base to flange, n of them; none if the values are not joint by joint.
        values: (n,), or of another shape; NaN if nothing is known.
        sigma: Likewise.
        seen: Likewise, whether the data say at least as much as the prior; the others' numbers are the prior's.
        covariance: (n, n) of the values; None if it is not kept.
    """

    joints: tuple[str, ...]
    values: Array
    sigma: Array
    seen: BoolArray
    covariance: Array | None = None


class Columns(NamedTuple):
    """Estimated columns of a kind: values by column, (size, k), and the prior's sigmas, (k,); None if free."""

    basis: Array
    sigma: Array | None


class Posture(NamedTuple):
    """A robot at recorded joints.

    Attributes:
        chain: As stated.
        recorded: Joints as recorded, (..., m, n) [rad].
        true: The chain as it is, where its joints truly stand.
    """

    chain: SerialChain
    recorded: Array
    true: ChainPosture


class Unobserved(NamedTuple):
    """Parameters of joints that the data do not hold.

    Attributes:
        joints: The joints in words.
        rows: Their numbers, from 0.
        joint_count: How many joints the robot has.
        base: The name of its base, in words.
        by_prior: Whether a prior holds them.
    """

    joints: str
    rows: tuple[int, ...]
    joint_count: int
    base: str
    by_prior: bool


def no_shift(chain: SerialChain, statement: Parameters, joints: Array, values: Array) -> Array | float:
    """The shift of joints by parameters that change the chain alone."""
    return 0.0


def same_chain(chain: SerialChain, values: Array) -> SerialChain:
    """The chain with parameters that shift its joints alone."""
    return chain


def expand_to_joints(joints: int) -> Array:
    """The values of a robot as stated, one for each joint."""
    return np.zeros(joints)


@dataclass(frozen=True, eq=False)
class RobotParameter:
    """A kind of parameters: values that are zero in the robot as stated, and their effect on it.

    Values may have a batch axis first; joints then have it, too, or serve all entries: ([b,] m, n).

    Attributes:
        stated: What `cell.yaml` may say of them, under the effect's name.
        one: One of them in words.
        derivative: Of `base_from_flange` to the values, right tangents, (..., m, 6, size), at a posture, as stated, at
            values.
        columns: All of them that may be estimated, if they are not fixed, for a chain as stated. Gauges are left out of
            free ones afterwards. Raises InputError if the robot lacks what they need; the message goes on from their
            name.
        report: A heading and lines of the values found of a robot.
        to_dict: The fields of `calibration.json`, of all robots; null if there are none.
        from_dict: The values in these fields, by robot.
        entry: The entry of `cell.yaml` that estimates them, by the values found (none if it is not known).
        zero: The values of a robot of so many joints as stated.
        shift: Added to joints as recorded, (..., m, n) [rad], by chain, statement, joints and values.
        moved: The chain with the values.
        is_by_joint: Whether they are a number for each joint; others are seen together or not at all.
        scale: What counts as much as a radian.
        largest_sigma: Of a free one that still counts as seen.
        unobserved: That the data do not hold those of some joints, why, and what compensates them.
    """

    stated: type[Parameters]
    one: str
    derivative: Callable[[Posture, Any, Array], Array]
    columns: Callable[[SerialChain, Any], Columns]
    report: Callable[[str, RobotParameters], list[str]]
    to_dict: Callable[[Mapping[str, RobotParameters]], dict[str, Any]]
    from_dict: Callable[[Mapping[str, Any]], dict[str, RobotParameters]]
    entry: Callable[[Array], str]
    zero: Callable[[int], Array] = expand_to_joints
    shift: Callable[[SerialChain, Any, Array, Array], Array | float] = no_shift
    moved: Callable[[SerialChain, Array], SerialChain] = same_chain
    is_by_joint: bool = True
    scale: float = 1.0
    largest_sigma: float = np.inf
    unobserved: Callable[[Unobserved], str] | None = None


def joint_lines(effect: RobotParameters, factor: float, unit: str, digits: int) -> list[str]:
    """A line for each joint, its value and sigma times a factor; NaN is unobservable, what is not seen the prior's."""
    lines, width = [], max(map(len, effect.joints))
    rows = zip(effect.joints, factor * effect.values, factor * effect.sigma, effect.seen, strict=True)
    for k, (name, value, sigma, observable) in enumerate(rows, 1):
        known = f"{round(value, digits) + 0.0:+10.{digits}f} {unit}    sigma {sigma:.{digits}f} {unit}"
        known += "" if observable else "    prior-dominated"
        lines.append(f"  {k}  {name:<{width}}  {known if np.isfinite(value) else '      unobservable'}")
    return lines
