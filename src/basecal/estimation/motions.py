"""What motions a recording holds, and what they cannot show whatever was seen: known before anything is solved.

A twist of a robot's base that every recorded pose of its flange carries to one and the same twist there cannot be told
from a change of what is mounted on that flange. A robot that stands still leaves all six of them, one that only shifts
the three shifts, one that turns about a single axis the shift along it at least.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from basecal.estimation.problem import Problem
from basecal.geometry import SE3, Array

HARDLY_RAD = 0.01
_HARDLY_M = 1e-3
_LENGTH_M = 0.5
_FEW = 3


@dataclass(frozen=True, eq=False)
class Motion:
    """How one robot moves over the samples in which it carries what sees or is seen.

    Attributes:
        robot: Its name.
        samples: How many samples.
        travel_m: How far its flange is from where it was at first, at most.
        turn_rad: (3,) how far it is turned since then about the axes of `axes_in_base`, at most, descending.
        axes_in_base: (3, 3) one axis a column.
        orientations: How many orientations differ by more than 0.01 rad, counted up to three.
        twists_in_base: (k, 6) [m, rad] twists of its base that no pose tells from a change of what it carries.
    """

    robot: str
    samples: int
    travel_m: float
    turn_rad: Array
    axes_in_base: Array
    orientations: int
    twists_in_base: Array

    @property
    def is_still(self) -> bool:
        """Whether it stands in one place."""
        return self.travel_m < _HARDLY_M and self.only_shifts

    @property
    def only_shifts(self) -> bool:
        """Whether its orientation hardly changes."""
        return bool(self.turn_rad[0] < HARDLY_RAD)

    @property
    def one_axis(self) -> bool:
        """Whether it turns about a single axis."""
        return not self.only_shifts and bool(self.turn_rad[1] < HARDLY_RAD)


def motions(problem: Problem) -> dict[str, Motion]:
    """How each robot of the views moves, by name."""
    return {robot: _motion(robot, poses) for robot, poses in _poses(problem).items()}


def _poses(problem: Problem) -> dict[str, SE3]:
    """Recorded poses of each robot, (n,), one a sample."""
    rows: dict[str, dict[int, SE3]] = {}
    for group in problem.groups:
        for robot, poses in (
            (group.eye, group.eye_base_from_eye_flange),
            (group.hand, group.hand_base_from_hand_flange),
        ):
            if robot is not None:
                rows.setdefault(robot, {}).update({int(n): poses[k] for k, n in enumerate(group.sample)})
    return {robot: SE3.stack([at[n] for n in sorted(at)]) for robot, at in sorted(rows.items()) if at}


def _motion(robot: str, base_from_flange: SE3) -> Motion:
    first = base_from_flange[0]
    turns = SE3(base_from_flange.rotation @ first.rotation.T, np.zeros((len(base_from_flange), 3))).rotvec
    axes = np.linalg.svd(turns, full_matrices=True)[2].T
    about = np.abs(turns @ axes).max(axis=0)
    order = np.argsort(-about)
    travel = float(np.linalg.norm(base_from_flange.translation - first.translation, axis=-1).max())
    twists = _indistinct_twists(base_from_flange)
    return Motion(robot, len(base_from_flange), travel, about[order], axes[:, order], _orientations(turns), twists)


def _orientations(turns: Array) -> int:
    """How many differ, at most three; turns since the first, (n, 3) [rad]."""
    rotations = SE3.from_rotvec(turns, np.zeros_like(turns))
    apart = np.ones(len(turns), dtype=bool)
    for count in range(_FEW):
        left = np.flatnonzero(apart)
        if not len(left):
            return count
        off = (rotations[int(left[0])].inverse() @ rotations).rotvec
        apart &= np.linalg.norm(off, axis=-1) > HARDLY_RAD
    return _FEW


def _indistinct_twists(base_from_flange: SE3) -> Array:
    """(k, 6) twists of the base that all poses carry to one twist of the flange, to a hundredth."""
    scale = np.array([_LENGTH_M] * 3 + [1.0] * 3)
    carried = base_from_flange.inverse().adjoint() * scale / scale[:, None]
    off = (carried - carried[0]).reshape(-1, 6)
    _, size, twists = np.linalg.svd(off, full_matrices=True)
    indistinct: Array = twists[size / np.sqrt(len(base_from_flange)) < HARDLY_RAD] * scale
    return indistinct


def attached(problem: Problem, robot: str) -> list[str]:
    """Names of the mounts on a robot's flange, of those that are in view."""
    names = [g.camera_mount for g in problem.groups if g.eye == robot]
    names += [g.target_mount for g in problem.groups if g.hand == robot]
    return list(dict.fromkeys(names))


def based(problem: Problem, robot: str) -> list[str]:
    """Names of the transforms that say where a robot's base stands: of the reference's, all that stand about it."""
    if robot != problem.reference:
        return [n for g in problem.groups for n in (g.eye_base, g.hand_base) if n and n.endswith(f"_from_{robot}_base")]
    names = [n for g in problem.groups for n in (g.eye_base, g.hand_base) if n is not None]
    names += [g.camera_mount for g in problem.groups if g.eye is None]
    names += [g.target_mount for g in problem.groups if g.hand is None]
    return list(dict.fromkeys(names))


def untold(problem: Problem, motion: Motion) -> tuple[str, ...]:
    """What moves along with a robot's base unnoticed, by its poses alone: none where something of it is known."""
    names = list(dict.fromkeys([*based(problem, motion.robot), *attached(problem, motion.robot)]))
    free = all(problem.unknowns[name].status == "free" for name in names)
    return tuple(names) if free and len(motion.twists_in_base) else ()


def narrowest(found: Iterable[Motion]) -> Motion | None:
    """The robot that turns least about a second axis."""
    return min(found, key=lambda motion: (motion.turn_rad[1], motion.turn_rad[0]), default=None)
