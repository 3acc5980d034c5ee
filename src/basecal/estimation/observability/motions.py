"""Motions of a recording, and the directions that they cannot show: known before anything is solved.

Consider a twist of a robot's base. If every recorded pose of the flange maps it to the same twist there, it cannot be
distinguished from a change of the flange's mount. A robot that stands still has all six such twists, and one that only
translates three. One that rotates about a single axis has at least the translation along it. Poses that deviate from
this by no more than their own noise show no more. What they seem to say of such a twist is their noise.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from basecal.estimation.problem.gauges import LEAST_RMS, MOVE_SCALE
from basecal.estimation.problem.problem import Problem, State
from basecal.geometry import SE3, Array
from basecal.numerics.batch import concatenate
from basecal.numerics.spectral import principal_axes, scaled_spectrum

STILL_RAD = 0.01  # turns below this say nothing of a rotation: their noise is as large [rad]; assumed
_STILL_M = 1e-3  # travel below this is standing still [m]; assumed
_NOISE_SIGMAS = 5.0  # a motion is one beyond five sigmas of the pose's noise, a chance of 6e-7
# Orientations that determine a hand-eye rotation: two turns about different axes (Tsai & Lenz 1989).
_FEWEST_ORIENTATIONS = 3


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
        twists_in_base: (k, 6) [m, rad] twists of its base that no pose distinguishes from a change of what it carries.
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
        return self.travel_m < _STILL_M and self.is_translation_only

    @property
    def is_translation_only(self) -> bool:
        """Whether its orientation hardly changes."""
        return bool(self.turn_rad[0] < STILL_RAD)


def motions(problem: Problem) -> dict[str, Motion]:
    """How each robot of the views moves, by name."""
    found, least = {}, _least_motion(problem)
    for robot, base_from_flange in _poses(problem).items():
        first = base_from_flange[0]
        turns = SE3(base_from_flange.rotation @ first.rotation.T, np.zeros((len(base_from_flange), 3))).rotvec
        axes = principal_axes(turns).axes
        about = np.abs(turns @ axes).max(axis=0)
        order = np.argsort(-about)
        travel = float(np.linalg.norm(base_from_flange.translation - first.translation, axis=-1).max())
        twists = _indistinct(base_from_flange, least.get(robot, LEAST_RMS))[0]
        count = len({int(n) for g in problem.all_groups if g.robot_end(robot) for n in g.sample})
        found[robot] = Motion(robot, count, travel, about[order], axes[:, order], _orientations(turns), twists)
    return found


def _poses(problem: Problem) -> dict[str, SE3]:
    """Recorded poses of each robot, (n,), one a view."""
    found = {robot: [end.base_from_flange for end in problem.robot_ends(robot)] for robot in problem.robots}
    return {robot: concatenate(found[robot]) for robot in sorted(found)}


def _orientations(turns: Array) -> int:
    """How many differ, at most three; turns since the first, (n, 3) [rad]."""
    rotations = SE3.from_rotvec(turns, np.zeros_like(turns))
    apart = np.ones(len(turns), dtype=bool)
    for count in range(_FEWEST_ORIENTATIONS):
        left = np.flatnonzero(apart)
        if not len(left):
            return count
        off = (rotations[int(left[0])].inverse() @ rotations).rotvec
        apart &= np.linalg.norm(off, axis=-1) > STILL_RAD
    return _FEWEST_ORIENTATIONS


def _least_motion(problem: Problem) -> dict[str, float]:
    """The least motion that counts, rms, of each robot with stated noise: some thousandths, and several sigmas."""
    noise = {name: float((problem.stops.sigma[k] / MOVE_SCALE).max()) for name, k in problem.stops.first.items()}
    return {name: max(LEAST_RMS, _NOISE_SIGMAS * largest) for name, largest in noise.items()}


def _indistinct(base_from_flange: SE3, least: float) -> tuple[Array, Array]:
    """Twists of the base that all poses carry to one twist of the flange, and that twist, (k, 6) each.

    Args:
        base_from_flange: (n,).
        least: By how much the carried twists may differ, rms, half a metre counting as a radian.
    """
    carried = base_from_flange.inverse().adjoint() * MOVE_SCALE / MOVE_SCALE[:, None]
    mean = carried.mean(0)
    off = (carried - mean).reshape(-1, 6)
    differing = scaled_spectrum(off.T @ off / len(carried), least**2)
    alike = differing.vectors[:, ~differing.held]
    return alike.T * MOVE_SCALE, (mean @ alike).T * MOVE_SCALE


def null_directions(problem: Problem, state: State) -> Array:
    """Directions of the unknowns, (p, k) [m, rad], that the recorded poses alone leave open, whatever was seen.

    Each moves a robot's base and what it carries so that the flange's poses hide it. Where any of these is fixed it is
    none. The paths of a flange with a target of one point may leave open more than these.
    """
    found, least = [], _least_motion(problem)
    for robot, poses in _poses(problem).items():
        at_base, at_flange = _indistinct(poses, least.get(robot, LEAST_RMS))
        found += [_direction(problem, state, robot, *pair) for pair in zip(at_base, at_flange, strict=True)]
    loose = [direction for direction in found if direction is not None]
    return np.stack(loose, axis=1) if loose else np.zeros((problem.width, 0))


def _direction(problem: Problem, state: State, robot: str, base_rotvec: Array, flange_rotvec: Array) -> Array | None:
    """How the unknowns move where a robot's base turns by one twist and all it carries by the other, backwards."""
    direction = np.zeros(problem.width)
    parts = [(name, -flange_rotvec) for name in mount_names(problem, robot)]
    parts += [
        (name, -base_rotvec if robot == problem.reference else base_rotvec) for name in base_names(problem, robot)
    ]
    for name, twist in parts:
        where = problem.columns.get(name)
        if where is None:
            return None
        inward = name in mount_names(problem, robot) or robot == problem.reference
        tangent = state.transforms[name].inverse().adjoint() @ twist if inward else twist
        direction[where] = tangent[: where.stop - where.start]
    return direction


def mount_names(problem: Problem, robot: str) -> list[str]:
    """Names of the mounts on a robot's flange, of those that see or are seen."""
    return list(dict.fromkeys(end.mount for end in problem.robot_ends(robot)))


def base_names(problem: Problem, robot: str) -> list[str]:
    """Names of the transforms that say where a robot's base stands: of the reference's, all that stand about it."""
    if robot != problem.reference:
        return [end.base for end in problem.robot_ends(robot) if end.base is not None]
    names = [end.base for group in problem.all_groups for end in group.ends if end.base is not None]
    names += [end.mount for end in problem.robot_ends(None) if end.base is None]
    return list(dict.fromkeys(names))


def gauge_partners(problem: Problem, motion: Motion) -> tuple[str, ...]:
    """Unknowns that move along with a robot's base unnoticed, by its poses alone; none if it has a prior."""
    names = list(dict.fromkeys([*base_names(problem, motion.robot), *mount_names(problem, motion.robot)]))
    free = all(problem.unknowns[name].status == "free" for name in names)
    return tuple(names) if free and len(motion.twists_in_base) else ()
