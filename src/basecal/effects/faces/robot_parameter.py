"""Robot parameters: effects on a robot with recorded joints that cell.yaml states and the solver estimates."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from basecal.effects.faces.candidates import Candidates, Moves, Views, one_candidate, robot_moves
from basecal.fields.parameters import Parameters
from basecal.geometry import Array, BoolArray, read_only
from basecal.kinematics import ChainPosture, SerialChain

JointRotation = Callable[[SerialChain, Array], Array]
"""Rotation of each joint by a unit of its value, (n, joints), at recorded joints, (n, joints) [rad]."""


@dataclass(frozen=True, eq=False)
class RobotParameters:
    """Estimates of one kind of parameters of one robot.

    Attributes:
        joints: Names of the n joints, from base to flange; empty if the values do not belong to single joints.
        values: Estimates, (n,) or another shape; NaN if they are unobservable.
        sigma: Sigmas, of the same shape.
        seen: Whether the data contribute at least as much as the prior, of the same shape.
        covariance: (n, n) of the values; None if it is not stored.
    """

    joints: tuple[str, ...]
    values: Array
    sigma: Array
    seen: BoolArray
    covariance: Array | None = None


class Columns(NamedTuple):
    """Estimated columns of a kind of parameters: values by column, (size, k), and prior sigmas, (k,); None if free."""

    basis: Array
    sigma: Array | None


class Posture(NamedTuple):
    """A robot at recorded joints.

    Attributes:
        chain: The stated chain.
        recorded: Recorded joints, (..., m, n) [rad].
        true: Posture of the true chain at its true joints.
    """

    chain: SerialChain
    recorded: Array
    true: ChainPosture


class Unobserved(NamedTuple):
    """Joint parameters that the data do not determine.

    Attributes:
        joints: Text that lists the joints.
        rows: Indices of the joints, from 0.
        joint_count: Number of joints of the robot.
        base: Text that names the robot's base.
        by_prior: Whether a prior determines them.
    """

    joints: str
    rows: tuple[int, ...]
    joint_count: int
    base: str
    by_prior: bool


def unchanged_chain(chain: SerialChain, values: Array) -> SerialChain:
    """The unchanged chain, for parameters that only shift joints."""
    return chain


def zero_by_joint(joints: int) -> Array:
    """Values of the stated robot: a zero for each joint."""
    return np.zeros(joints)


@dataclass(frozen=True, eq=False)
class RobotParameter:
    """A kind of parameters that are zero for the stated robot, and their effect on the robot.

    Values may have a leading batch axis; joints then have it too, or apply to all entries: ([b,] m, n).

    Attributes:
        stated: Schema of their statement in `cell.yaml`, under the effect's name.
        singular: Text that names a single parameter.
        columns: Columns that may be estimated for a stated chain. Gauges are removed from free ones afterwards. Raises
            InputError if the robot lacks required data; the message continues from the name of the parameters.
        report: A heading and lines for the estimates of a robot.
        to_dict: Fields of `calibration.json` for all robots; null if there are none.
        from_dict: Values of these fields for each robot.
        entry: Entry of `cell.yaml` that estimates them, given found values (empty if unknown).
        zero: Values of the stated robot, for a number of joints.
        turn: Rotation of each recorded joint by a unit of its value, (..., m, n) [rad], from chain, statement and
            joints. It is None if values only change the chain.
        move_chain: The chain with the values applied.
        chain_derivative: Derivative of `base_from_flange` with respect to values that change the chain.
        is_by_joint: Whether there is a number for each joint; others are observable together or not at all.
        scale: Change that is equivalent to one radian.
        largest_sigma: Largest sigma of a free parameter that counts as observable.
        unobserved: Text that says which joints the data do not determine, why, and what compensates them.
    """

    stated: type[Parameters]
    singular: str
    columns: Callable[[SerialChain, Any], Columns]
    report: Callable[[str, RobotParameters], list[str]]
    to_dict: Callable[[Mapping[str, RobotParameters]], dict[str, Any]]
    from_dict: Callable[[Mapping[str, Any]], dict[str, RobotParameters]]
    entry: Callable[[Array], str]
    zero: Callable[[int], Array] = zero_by_joint
    turn: Callable[[SerialChain, Any, Array], Array] | None = None
    move_chain: Callable[[SerialChain, Array], SerialChain] = unchanged_chain
    chain_derivative: Callable[[Posture, Array], Array] | None = None
    is_by_joint: bool = True
    scale: float = 1.0
    largest_sigma: float = np.inf
    unobserved: Callable[[Unobserved], str] | None = None

    def shift(self, chain: SerialChain, statement: Parameters, joints: Array, values: Array) -> Array | float:
        """Rotations to add to recorded joints, (..., m, n) [rad]."""
        if self.turn is None:
            return 0.0
        return (values[..., None, :] if values.ndim > 1 else values) * self.turn(chain, statement, joints)

    def derivative(self, posture: Posture, statement: Parameters, values: Array) -> Array:
        """Derivative of `base_from_flange` with respect to the values, right tangents, (..., m, 6, size)."""
        if self.turn is None:
            assert self.chain_derivative is not None
            return self.chain_derivative(posture, values)
        turns = self.turn(posture.chain, statement, posture.recorded)
        return posture.true.joint_derivative * turns[..., None, :]


def joint_columns(chain: SerialChain, sigma: float | None) -> Columns:
    """A column for each joint, all with the same prior sigma; free if it is None."""
    return Columns(np.eye(chain.n), None if sigma is None else np.full(chain.n, sigma))


def draw_by_joint(size: float, joints: int, rng: np.random.Generator) -> Array:
    """Normally distributed values with a standard deviation of `size`, (joints,)."""
    return np.asarray(size * rng.standard_normal(joints))


def joint_lines(effect: RobotParameters, factor: float, unit: str, digits: int) -> list[str]:
    """A line for each joint with its value and sigma, multiplied by a factor; NaN prints as unobservable."""
    lines, width = [], max(map(len, effect.joints))
    rows = zip(effect.joints, factor * effect.values, factor * effect.sigma, effect.seen, strict=True)
    for k, (name, value, sigma, observable) in enumerate(rows, 1):
        known = f"{round(value, digits) + 0.0:+10.{digits}f} {unit}    sigma {sigma:.{digits}f} {unit}"
        known += "" if observable else "    prior-dominated"
        lines.append(f"  {k}  {name:<{width}}  {known if np.isfinite(value) else '      unobservable'}")
    return lines


def unestimated_chains(views: Views, name: str) -> Iterator[tuple[str, SerialChain]]:
    """Robots with recorded joints whose parameters of a kind are not estimated, with their chains."""
    return (
        (robot, chain) for robot, chain in views.chains.items() if name not in views.estimated_effects.get(robot, ())
    )


def moves_by_joint(views: Views, robot: str, chain: SerialChain, turn: JointRotation) -> Moves:
    """Derivatives of each group's views with respect to each joint's value, (n, 6, joints)."""

    def moves(views: Views, k: int, robot: str) -> Array:
        """Moves of a group."""
        end = views.groups[k].robot_end(robot)
        if end is None or end.joints is None:
            return np.zeros((len(views.groups[k]), 6, chain.n))
        return views.flange_jacobian(k, robot) @ (chain.jacobian(end.joints) * turn(chain, end.joints)[:, None, :])

    return robot_moves(views, robot, moves)


def joint_candidates(code: str, robot: str, unit: str, moves: Moves) -> Iterator[Candidates]:
    """Candidates: each joint alone, then all joints of a robot together, for errors that no single joint explains."""
    count = next(m.shape[-1] for m in moves if m is not None)
    each = tuple(None if m is None else np.swapaxes(m, -1, -2)[..., None] for m in moves)
    yield Candidates(code, (robot,) * count, (None,) * count, unit, each, tuple(range(count)))
    yield one_candidate(f"{code}s", robot, unit, moves)


def to_dict(name: str, keys: tuple[str, str], effect: Mapping[str, RobotParameters]) -> dict[str, Any]:
    """The field of `calibration.json`, with the given keys for values and sigmas."""
    by_robot = {
        robot: {keys[0]: each.values, keys[1]: each.sigma, "seen": each.seen, "joint_names": each.joints}
        for robot, each in effect.items()
    }
    return {name: by_robot or None}


def from_dict(name: str, keys: tuple[str, str], data: Mapping[str, Any]) -> dict[str, RobotParameters]:
    """Read the field of `calibration.json` into the parameters of each robot."""
    found = {}
    for robot, entry in (data.get(name) or {}).items():
        names = tuple(entry["joint_names"])
        values, sigma = (read_only(entry[key], (len(names),), key) for key in keys)
        found[robot] = RobotParameters(names, values, sigma, np.array(entry["seen"], dtype=bool))
    return found
