"""Effects of single joints: how views move with each, and values by joint as `calibration.json` holds them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np

from basecal.effects.faces.candidates import Candidates, one_candidate
from basecal.effects.faces.robot_parameter import RobotParameters
from basecal.effects.faces.views import Moves, Views
from basecal.geometry import Array, read_only
from basecal.kinematics import SerialChain

ByJoints = Callable[[SerialChain, Array], Array]
"""By how much each joint turns by a unit of its value, at recorded joints (n, joints) [rad]."""


def open_chains(views: Views, name: str) -> Iterator[tuple[str, SerialChain]]:
    """Robots that are recorded by joints and whose parameters of a name are not estimated, with their chains."""
    return (
        (robot, chain) for robot, chain in views.chains.items() if name not in views.estimated_effects.get(robot, ())
    )


def moves_by_joint(views: Views, robot: str, chain: SerialChain, turn: ByJoints) -> Moves:
    """How views of each group move with a unit of each joint's value, (n, 6, joints)."""

    def group_moves(k: int) -> Array | None:
        """Moves of a group, (n, 6, joints); None if the robot carries nothing there."""
        group = views.groups[k]
        end = group.robot_end(robot)
        if end is None:
            return None
        if end.joints is None:
            return np.zeros((len(group), 6, chain.n))
        return views.flange_jacobian(k, robot) @ (chain.jacobian(end.joints) * turn(chain, end.joints)[:, None, :])

    return tuple(group_moves(k) for k in range(len(views.groups)))


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
