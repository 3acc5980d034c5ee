"""Robot motions of a recording, and the directions that they leave unobservable, before anything is solved.

Consider a twist of a robot's base. If every recorded flange pose maps it to the same twist of the flange, it cannot be
distinguished from a change of the mount. A robot at rest has all six such twists, a robot that only translates has
three. A robot that rotates about a single axis has at least the translation along this axis. Deviations of the poses
within their own noise contain no information on such a twist.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from basecal.estimation.problem.gauges import LEAST_RMS_RAD, MOVE_SCALE
from basecal.estimation.problem.problem import Problem, State
from basecal.geometry import SE3, Array
from basecal.numerics.batch import concatenate
from basecal.numerics.spectral import principal_axes, scaled_spectrum

STILL_RAD = 0.01  # smaller rotations are as small as their noise and determine no rotation [rad]; assumed
_STILL_M = 1e-3  # a robot with a smaller travel is at rest [m]; assumed
_NOISE_SIGMAS = 5.0  # motions beyond five sigmas of the pose noise are significant; false alarms have probability 6e-7
# Orientations that determine a hand-eye rotation: two rotations about different axes (Tsai & Lenz 1989).
_FEWEST_ORIENTATIONS = 3


@dataclass(frozen=True, eq=False)
class Motion:
    """Motion of one robot over the samples in which its camera or target is used.

    Attributes:
        robot: Name of the robot.
        samples: Number of samples.
        travel_m: Largest distance of the flange from its first position [m].
        turn_rad: (3,) largest rotation from the first orientation about each of `axes_in_base`, descending [rad].
        axes_in_base: (3, 3) principal axes of rotation as columns.
        orientations: Number of orientations that differ by more than 0.01 rad, counted up to three.
        twists_in_base: (k, 6) [m, rad] twists of the base that no pose distinguishes from a change of the mounts.
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
        """Whether the robot is at rest in all samples."""
        return self.travel_m < _STILL_M and self.is_translation_only

    @property
    def is_translation_only(self) -> bool:
        """Whether the orientation changes by less than 0.01 rad."""
        return bool(self.turn_rad[0] < STILL_RAD)


def motions(problem: Problem) -> dict[str, Motion]:
    """Motion of each robot of the views, by name."""
    by_robot, least = {}, _least_motion(problem)
    for robot, base_from_flange in _poses(problem).items():
        first = base_from_flange[0]
        rotvecs = SE3(base_from_flange.rotation @ first.rotation.T, np.zeros((len(base_from_flange), 3))).rotvec
        axes = principal_axes(rotvecs).axes
        extents = np.abs(rotvecs @ axes).max(axis=0)
        order = np.argsort(-extents)
        travel = float(np.linalg.norm(base_from_flange.translation - first.translation, axis=-1).max())
        twists = _indistinct_twists(base_from_flange, least.get(robot, LEAST_RMS_RAD))[0]
        count = len({int(n) for g in problem.all_groups if g.robot_end(robot) for n in g.sample})
        by_robot[robot] = Motion(robot, count, travel, extents[order], axes[:, order], _orientations(rotvecs), twists)
    return by_robot


def _poses(problem: Problem) -> dict[str, SE3]:
    """Recorded poses of each robot, (n,), one per view, by name."""
    parts = {robot: [end.base_from_flange for end in problem.robot_ends(robot)] for robot in problem.robots}
    return {robot: concatenate(parts[robot]) for robot in sorted(parts)}


def _orientations(rotvecs: Array) -> int:
    """Number of distinct orientations, up to three, from rotation vectors relative to the first, (n, 3) [rad]."""
    rotations = SE3.from_rotvec(rotvecs, np.zeros_like(rotvecs))
    is_left = np.ones(len(rotvecs), dtype=bool)
    for count in range(_FEWEST_ORIENTATIONS):
        remaining = np.flatnonzero(is_left)
        if not len(remaining):
            return count
        differences = (rotations[int(remaining[0])].inverse() @ rotations).rotvec
        is_left &= np.linalg.norm(differences, axis=-1) > STILL_RAD
    return _FEWEST_ORIENTATIONS


def _least_motion(problem: Problem) -> dict[str, float]:
    """Least significant RMS motion of each robot with stated noise [rad]: 3e-3, or five sigmas if that is more."""
    noise = {name: float((problem.stops.sigma[k] / MOVE_SCALE).max()) for name, k in problem.stops.first.items()}
    return {name: max(LEAST_RMS_RAD, _NOISE_SIGMAS * largest) for name, largest in noise.items()}


def _indistinct_twists(base_from_flange: SE3, least: float) -> tuple[Array, Array]:
    """Twists of the base that all poses map to one twist of the flange, and this twist, (k, 6) each [m, rad].

    Args:
        base_from_flange: (n,) poses.
        least: Largest RMS difference of the mapped twists [rad], with 0.5 m equal to 1 rad.
    """
    adjoints = base_from_flange.inverse().adjoint() * MOVE_SCALE / MOVE_SCALE[:, None]
    mean = adjoints.mean(0)
    deviations = (adjoints - mean).reshape(-1, 6)
    scatter = scaled_spectrum(deviations.T @ deviations / len(adjoints), least**2)
    constant = scatter.vectors[:, ~scatter.is_informative]
    return constant.T * MOVE_SCALE, (mean @ constant).T * MOVE_SCALE


def null_directions(problem: Problem, state: State) -> Array:
    """Directions of the unknowns, (p, k) [m, rad], that are unobservable because of the recorded poses alone.

    Each direction moves a robot's base and the mounts on its flange without effect on the views. Directions that would
    move a fixed transform are left out. With a target of one point, more directions may be unobservable.
    """
    directions, least = [], _least_motion(problem)
    for robot, poses in _poses(problem).items():
        at_base, at_flange = _indistinct_twists(poses, least.get(robot, LEAST_RMS_RAD))
        directions += [_direction(problem, state, robot, *pair) for pair in zip(at_base, at_flange, strict=True)]
    free = [direction for direction in directions if direction is not None]
    return np.stack(free, axis=1) if free else np.zeros((problem.width, 0))


def _direction(problem: Problem, state: State, robot: str, base_twist: Array, flange_twist: Array) -> Array | None:
    """Direction of the unknowns, (p,), for a twist of a robot's base and the opposite twist of its mounts.

    None if one of the transforms is fixed.
    """
    direction = np.zeros(problem.width)
    twists = [(name, -flange_twist) for name in mount_names(problem, robot)]
    twists += [(name, -base_twist if robot == problem.reference else base_twist) for name in base_names(problem, robot)]
    for name, twist in twists:
        columns = problem.columns.get(name)
        if columns is None:
            return None
        is_in_parent = name in mount_names(problem, robot) or robot == problem.reference
        tangent = state.transforms[name].inverse().adjoint() @ twist if is_in_parent else twist
        direction[columns] = tangent[: columns.stop - columns.start]
    return direction


def mount_names(problem: Problem, robot: str) -> list[str]:
    """Names of the mounts of cameras and targets on a robot's flange."""
    return list(dict.fromkeys(end.mount for end in problem.robot_ends(robot)))


def base_names(problem: Problem, robot: str) -> list[str]:
    """Names of the transforms that place a robot's base; for the reference, all other transforms in the world."""
    if robot != problem.reference:
        return [end.base for end in problem.robot_ends(robot) if end.base is not None]
    names = [end.base for group in problem.all_groups for end in group.ends if end.base is not None]
    names += [end.mount for end in problem.robot_ends(None) if end.base is None]
    return list(dict.fromkeys(names))


def gauge_partners(problem: Problem, motion: Motion) -> tuple[str, ...]:
    """Names of unknowns that the robot's poses do not separate; empty if one has a prior or is fixed."""
    names = list(dict.fromkeys([*base_names(problem, motion.robot), *mount_names(problem, motion.robot)]))
    free = all(problem.unknowns[name].status == "free" for name in names)
    return tuple(names) if free and len(motion.twists_in_base) else ()
