"""The face of a kind of robot parameters, a module of `basecal.cell.robot_parameters`, and those there are."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache
from importlib import import_module
from typing import Any, NamedTuple, Protocol

import numpy as np

from basecal.cell.calibration import RobotParameters
from basecal.cell.format.parameters import Parameters
from basecal.geometry import Array
from basecal.kinematics import ChainPosture, SerialChain
from basecal.registry import ROBOT_PARAMETERS


class Columns(NamedTuple):
    """What of a kind is estimated: values by column, (size, k), and the prior's sigmas, (k,); None where free."""

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


class RobotParameterKind(Protocol):
    """A kind of parameters: values that are zero in the robot as stated, and what they do to it.

    Values may have a batch axis first; joints then have it, too, or serve all entries: ([b,] m, n).

    Attributes:
        Stated: What `cell.yaml` may say of them, under the kind's name.
        BY_JOINT: Whether they are a number for each joint; others are seen together or not at all.
        ONE: One of them in words, or an error of them.
        SCALE: What counts as much as a radian.
        LARGEST_SIGMA: Of a free one that still counts as seen.
    """

    Stated: type[Parameters]
    BY_JOINT: bool
    ONE: str
    SCALE: float
    LARGEST_SIGMA: float

    def zero(self, joints: int) -> Array:
        """The values of a robot as stated."""

    def columns(self, chain: SerialChain, stated: Parameters) -> Columns:
        """All of them that may be estimated, where they are not fixed; gauges are left out of free ones afterwards.

        Args:
            chain: The robot as stated.
            stated: What is known of them.

        Raises:
            InputError: if the robot lacks what they need; the message goes on from their name.
        """

    def shift(self, chain: SerialChain, stated: Parameters, joints: Array, values: Array) -> Array | float:
        """What is added to joints as recorded, (..., m, n) [rad]."""

    def moved(self, chain: SerialChain, values: Array) -> SerialChain:
        """The chain as they make it."""

    def derivative(self, at: Posture, stated: Parameters, values: Array) -> Array:
        """Derivative of `base_from_flange` to the values, right tangents, (..., m, 6, size)."""

    def unobserved(self, joints: str, rows: Sequence[int], count: int, base: str, by_prior: bool) -> str:
        """That the data do not hold those of some joints, why, and what makes up for them.

        Args:
            joints: The joints in words.
            rows: Their numbers, from 0.
            count: How many joints the robot has.
            base: What its base is, in words.
            by_prior: Whether a prior holds them.
        """

    def report(self, robot: str, found: RobotParameters) -> list[str]:
        """What was found, a heading and lines."""

    def to_dict(self, found: Mapping[str, RobotParameters]) -> dict[str, Any]:
        """The fields of `calibration.json`, of all robots; null where there are none."""

    def from_dict(self, data: Mapping[str, Any]) -> dict[str, RobotParameters]:
        """What these fields hold, by robot."""


@cache
def robot_parameter_kinds() -> Mapping[str, RobotParameterKind]:
    """The kinds there are, by name."""
    modules: dict[str, Any] = {
        name: import_module(f"basecal.cell.robot_parameters.{name}") for name in ROBOT_PARAMETERS
    }
    return modules


def joint_lines(found: RobotParameters, factor: float, unit: str, digits: int) -> list[str]:
    """A line for each joint, its value and sigma times a factor; NaN is unobservable, what is not seen the prior's."""
    lines, width = [], max(map(len, found.joints))
    rows = zip(found.joints, factor * found.values, factor * found.sigma, found.seen, strict=True)
    for k, (name, value, sigma, observable) in enumerate(rows, 1):
        known = f"{round(value, digits) + 0.0:+10.{digits}f} {unit}    sigma {sigma:.{digits}f} {unit}"
        known += "" if observable else "    prior-dominated"
        lines.append(f"  {k}  {name:<{width}}  {known if np.isfinite(value) else '      unobservable'}")
    return lines
