"""An effect as parameters of a robot that is recorded by joints: as cell.yaml states them and as they are estimated."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from basecal.effects.faces.candidates import Candidates, Moves, Views, one_candidate, robot_moves
from basecal.fields.parameters import Parameters
from basecal.geometry import Array, BoolArray, read_only
from basecal.kinematics import ChainPosture, SerialChain

ByJoints = Callable[[SerialChain, Array], Array]
"""By how much each joint turns by a unit of its value, at recorded joints (n, joints) [rad]."""


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
        columns: All of them that may be estimated, if they are not fixed, for a chain as stated. Gauges are left out of
            free ones afterwards. Raises InputError if the robot lacks what they need; the message goes on from their
            name.
        report: A heading and lines of the values found of a robot.
        to_dict: The fields of `calibration.json`, of all robots; null if there are none.
        from_dict: The values in these fields, by robot.
        entry: The entry of `cell.yaml` that estimates them, by the values found (none if it is not known).
        zero: The values of a robot of so many joints as stated.
        turn: Turn of each joint as recorded by a unit of its value, (..., m, n) [rad], by chain, statement and joints.
            It is None if values change the chain alone.
        moved: The chain with the values.
        chain_derivative: Of `base_from_flange` to values that change the chain, at a posture and values.
        is_by_joint: Whether they are a number for each joint; others are seen together or not at all.
        scale: What counts as much as a radian.
        largest_sigma: Of a free one that still counts as seen.
        unobserved: That the data do not hold those of some joints, why, and what compensates them.
    """

    stated: type[Parameters]
    one: str
    columns: Callable[[SerialChain, Any], Columns]
    report: Callable[[str, RobotParameters], list[str]]
    to_dict: Callable[[Mapping[str, RobotParameters]], dict[str, Any]]
    from_dict: Callable[[Mapping[str, Any]], dict[str, RobotParameters]]
    entry: Callable[[Array], str]
    zero: Callable[[int], Array] = expand_to_joints
    turn: Callable[[SerialChain, Any, Array], Array] | None = None
    moved: Callable[[SerialChain, Array], SerialChain] = same_chain
    chain_derivative: Callable[[Posture, Array], Array] | None = None
    is_by_joint: bool = True
    scale: float = 1.0
    largest_sigma: float = np.inf
    unobserved: Callable[[Unobserved], str] | None = None

    def shift(self, chain: SerialChain, statement: Parameters, joints: Array, values: Array) -> Array | float:
        """Turns to be added to joints as recorded, (..., m, n) [rad]."""
        if self.turn is None:
            return 0.0
        return (values[..., None, :] if values.ndim > 1 else values) * self.turn(chain, statement, joints)

    def derivative(self, posture: Posture, statement: Parameters, values: Array) -> Array:
        """Derivative of `base_from_flange` to the values, right tangents, (..., m, 6, size)."""
        if self.turn is None:
            assert self.chain_derivative is not None
            return self.chain_derivative(posture, values)
        turns = self.turn(posture.chain, statement, posture.recorded)
        return posture.true.joint_derivative * turns[..., None, :]


def joint_columns(chain: SerialChain, sigma: float | None) -> Columns:
    """A column for each joint, with one sigma; free if it is None."""
    return Columns(np.eye(chain.n), None if sigma is None else np.full(chain.n, sigma))


def draw_by_joint(size: float, joints: int, rng: np.random.Generator) -> Array:
    """Values of one sigma."""
    return np.asarray(size * rng.standard_normal(joints))


def joint_lines(effect: RobotParameters, factor: float, unit: str, digits: int) -> list[str]:
    """A line for each joint, its value and sigma times a factor; NaN is unobservable, what is not seen the prior's."""
    lines, width = [], max(map(len, effect.joints))
    rows = zip(effect.joints, factor * effect.values, factor * effect.sigma, effect.seen, strict=True)
    for k, (name, value, sigma, observable) in enumerate(rows, 1):
        known = f"{round(value, digits) + 0.0:+10.{digits}f} {unit}    sigma {sigma:.{digits}f} {unit}"
        known += "" if observable else "    prior-dominated"
        lines.append(f"  {k}  {name:<{width}}  {known if np.isfinite(value) else '      unobservable'}")
    return lines


def open_chains(views: Views, name: str) -> Iterator[tuple[str, SerialChain]]:
    """Robots that are recorded by joints and whose parameters of a name are not estimated, with their chains."""
    return (
        (robot, chain) for robot, chain in views.chains.items() if name not in views.estimated_effects.get(robot, ())
    )


def moves_by_joint(views: Views, robot: str, chain: SerialChain, turn: ByJoints) -> Moves:
    """How views of each group move with a unit of each joint's value, (n, 6, joints)."""

    def moves(views: Views, k: int, robot: str) -> Array:
        """Moves of a group."""
        end = views.groups[k].robot_end(robot)
        if end is None or end.joints is None:
            return np.zeros((len(views.groups[k]), 6, chain.n))
        return views.flange_jacobian(k, robot) @ (chain.jacobian(end.joints) * turn(chain, end.joints)[:, None, :])

    return robot_moves(views, robot, moves)


def joint_candidates(code: str, robot: str, unit: str, moves: Moves) -> Iterator[Candidates]:
    """Each joint alone, then all joints of a robot at once: if many are off, none alone explains much."""
    count = next(m.shape[-1] for m in moves if m is not None)
    each = tuple(None if m is None else np.swapaxes(m, -1, -2)[..., None] for m in moves)
    yield Candidates(code, (robot,) * count, (None,) * count, unit, each, tuple(range(count)))
    yield one_candidate(f"{code}s", robot, unit, moves)


def to_dict(name: str, keys: tuple[str, str], effect: Mapping[str, RobotParameters]) -> dict[str, Any]:
    """The field of `calibration.json`, by the keys of values and sigmas."""
    by_robot = {
        robot: {keys[0]: of.values, keys[1]: of.sigma, "seen": of.seen, "joint_names": of.joints}
        for robot, of in effect.items()
    }
    return {name: by_robot or None}


def from_dict(name: str, keys: tuple[str, str], data: Mapping[str, Any]) -> dict[str, RobotParameters]:
    """The values in this field, by robot."""
    found = {}
    for robot, entry in (data.get(name) or {}).items():
        names = tuple(entry["joint_names"])
        values, sigma = (read_only(entry[key], (len(names),), key) for key in keys)
        found[robot] = RobotParameters(names, values, sigma, np.array(entry["seen"], dtype=bool))
    return found
