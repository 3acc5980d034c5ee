"""Clearance between arms and to keep-out boxes, and path lengths of their points, on paths straight in joint space."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations

import numpy as np
import scipy  # its parts are loaded when they are first used

from basecal.cell import CellCamera, CellTarget, KeepOut, Sample
from basecal.errors import InputError
from basecal.geometry import SE3, Array, IntArray
from basecal.kinematics.collision import Capsules, body_capsules, box_capsules
from basecal.numerics.batch import concatenate
from basecal.planning.sketch import Sketch, target_points

_CLEARANCE_M = 0.02  # about each arm: its points move at most this far from the nearest checked place of a path
_PADDING_M = 0.06  # radius of a link without geometry, and padding of a carried camera or target
_STEP_RAD = 0.05  # between places at which the speed of points is evaluated
_CHORD_FACTOR = 1.02  # largest ratio of an arc of 0.1 rad to its chord, with the change of speed along it
_STANDING_FRAMES = 2  # base and first joint of an arm, which touch what the arm is mounted on
_CHUNK_PAIRS = 500_000  # pairs of capsules whose distances are in memory at once
_SEGMENT_POINTS = 65  # points of a segment whose distance to a box is computed
_ROUNDING_M = 1e-9  # rounding error of a distance [m]
_TINY_M2 = 1e-12  # square of a length that counts as zero [m^2]


@dataclass(frozen=True)
class Clearance:
    """Clearance between a robot and another robot or a box.

    Attributes:
        robot: Name of the robot.
        other: Name of the other robot or of the box.
        gap_m: Smallest distance at the sampled places of the path [m]; no point is farther than 0.02 m from one.
        needed_m: Required distance [m]: 0.02 m per arm.
    """

    robot: str
    other: str
    gap_m: float
    needed_m: float

    @property
    def is_enough(self) -> bool:
        """Whether the required distance is kept on the whole path."""
        return self.gap_m >= self.needed_m


def clearances(sketch: Sketch, start: Sample, end: Sample, moving: Collection[str]) -> Iterator[Clearance]:
    """Clearances between robots, and to keep-out boxes, on the path to a sample.

    The robots are not synchronised: each place on the path of one is compared with all places on the path of the other.
    The base and first joint may be near boxes. Robots whose joints are unknown are omitted.

    Args:
        sketch: The cell.
        start: States of the robots at the start of the path.
        end: States of the robots at its end.
        moving: Names of the robots that move; pairs without a moving robot are omitted.
    """
    swept = {
        name: capsules for name in end.robots if (capsules := _swept_capsules(sketch, start, end, name)) is not None
    }
    for first, second in combinations(swept, 2):
        if first in moving or second in moving:
            first_capsules, second_capsules = (swept[name].reshape(-1, 7) for name in (first, second))
            parts = np.array_split(first_capsules, len(first_capsules) * len(second_capsules) // _CHUNK_PAIRS + 1)
            gap_m = min(_arms_gap(part, second_capsules) for part in parts)
            yield Clearance(first, second, gap_m, 2 * _CLEARANCE_M)
    for name in [name for name in swept if name in moving]:
        for box in sketch.cell.keep_out.values():
            is_movable = robot_capsules(sketch, name)[0].frame >= _STANDING_FRAMES
            yield Clearance(name, box.name, _box_gap(swept[name][is_movable].reshape(-1, 7), box), _CLEARANCE_M)


def path_m_per_rad(sketch: Sketch, start: Sample, end: Sample, robot: str) -> float | None:
    """Path length of the fastest point of a robot per radian of its leading joint [m/rad].

    The maximum over a path straight in joint space, and over links, camera and target; None if joints are unknown.
    """
    ends = _ends(sketch, start, end, robot)
    if ends is None:
        return None
    leading = float(np.abs(ends[1] - ends[0]).max())
    if leading == 0:
        return 0.0
    count = int(leading / _STEP_RAD) + 2
    rotation, segments = _place_capsules(sketch, robot, np.linspace(*ends, count))
    chords = np.linalg.norm(np.diff(rotation, axis=1), axis=(-2, -1)) / np.sqrt(2)  # chord of the unit circle
    radial = chords * robot_capsules(sketch, robot)[0].radius[:, None]
    steps = np.linalg.norm(np.diff(segments, axis=1), axis=-1).max(-1) + radial
    return _CHORD_FACTOR * float(steps.max()) * (count - 1) / leading


def _ends(sketch: Sketch, start: Sample, end: Sample, robot: str) -> tuple[Array, Array] | None:
    """Joints at the start and the end of a path, (n,) each [rad]; None if the joints or the chain are unknown."""
    first, last = (sample.robots[robot].joints_rad if robot in sample.robots else None for sample in (start, end))
    if first is None or last is None or sketch.cell.robots[robot].chain is None:
        return None
    return first, last


@lru_cache(maxsize=16)
def robot_capsules(sketch: Sketch, robot: str) -> tuple[Capsules, list[str]]:
    """Capsules that enclose a robot's links, cameras and targets, and messages for link geometry that is unreadable.

    A frame without readable geometry is replaced by a capsule from its joint to the next.
    """
    chain = sketch.cell.robots[robot].chain
    assert chain is not None
    parts, problems, bare_frames = list[Capsules](), list[str](), {*range(chain.n + 1)}
    bare_frames -= {body.frame for body in chain.collisions}
    for body in chain.collisions:
        try:
            parts.append(body_capsules(body))
        except InputError as error:
            problems.append(f"link {body.link!r}: {error}")
            bare_frames.add(body.frame)
    steps = [*chain.origins.translation, chain.tip.translation]
    for frame in bare_frames:
        segments = np.stack([np.zeros(3), steps[frame]])[None]
        parts.append(Capsules(np.array([frame]), segments, np.zeros(1), np.array([_PADDING_M])))
    carried: list[CellCamera | CellTarget] = [*sketch.cell.cameras.values(), *sketch.cell.targets.values()]
    for load in carried:
        if load.on == robot:
            points = target_points(load.target if isinstance(load, CellTarget) else None)
            mount = sketch.transforms[sketch.cell.mount_name(load.name)]
            parts.append(box_capsules(chain.n + 1, mount, np.stack([points.min(0), points.max(0)]), _PADDING_M))
    frame, segments, radius, padding = map(np.concatenate, zip(*parts, strict=True))
    return Capsules(frame, segments, radius, padding), problems


def _place_capsules(sketch: Sketch, robot: str, joints: Array) -> tuple[Array, Array]:
    """Rotations of capsules, (k, m, 3, 3), and their end points in the world, (k, m, 2, 3) [m], at joints, (m, n)."""
    chain, capsules = sketch.cell.robots[robot].chain, robot_capsules(sketch, robot)[0]
    assert chain is not None
    joint_frames = chain.joint_frames(joints)
    parts = SE3.identity((1, len(joints))), joint_frames, joint_frames[-1:] @ chain.tip
    world_from = sketch.world_from_base(robot) @ concatenate(parts)[capsules.frame]
    return world_from.rotation, capsules.ends[:, None] @ world_from.rotation.mT + world_from.translation[:, :, None]


def _swept_capsules(sketch: Sketch, start: Sample, end: Sample, robot: str) -> Array | None:
    """End points and radii of a robot's capsules along its path, (k, m, 7) [m]; None if its joints are unknown."""
    ends = _ends(sketch, start, end, robot)
    if ends is None:
        return None
    capsules = robot_capsules(sketch, robot)[0]
    path_m = (path_m_per_rad(sketch, start, end, robot) or 0.0) * np.abs(ends[1] - ends[0]).max()
    count = int(path_m / (2 * _CLEARANCE_M)) + 2 if path_m else 1
    segments = _place_capsules(sketch, robot, np.linspace(*ends, count))[1]
    shape = segments.shape[:2]
    radius = np.broadcast_to((capsules.radius + capsules.padding)[:, None, None], (*shape, 1))
    return np.concatenate([segments.reshape(*shape, 6), radius], axis=-1)


def _arms_gap(capsules: Array, other_capsules: Array) -> float:
    """Smallest distance between two sets of capsules, (n, 7) and (m, 7) [m]."""
    (middles, reach), (other_middles, other_reach) = _bounding_spheres(capsules), _bounding_spheres(other_capsules)
    bound = scipy.spatial.distance.cdist(middles, other_middles) - reach[:, None] - other_reach
    return _least_gap(bound, lambda rows, columns: _gaps(capsules[rows], other_capsules[columns]))


def _box_gap(capsules: Array, box: KeepOut) -> float:
    """Smallest distance of capsules, (n, 7), from a box [m]; up to 1 % of a link's length too small, -radius inside."""
    middles, reach = _bounding_spheres(capsules)

    def gap(rows: IntArray) -> Array:
        """Distances of the selected capsules from the box."""
        starts, ends, radius = np.split(capsules[rows], (3, 6), axis=-1)
        points = starts + np.linspace(0, 1, _SEGMENT_POINTS)[:, None, None] * (ends - starts)
        half_step = 0.5 * np.linalg.norm(
            points[1] - points[0], axis=-1
        )  # a point between two samples may be nearer by this
        return np.asarray(box.distance(points).min(0) - half_step - radius[:, 0])

    return _least_gap(box.distance(middles) - reach, gap)


def _bounding_spheres(capsules: Array) -> tuple[Array, Array]:
    """Centres, (n, 3), and radii, (n,), of the bounding spheres of capsules, (n, 7) [m]."""
    starts, ends, radius = np.split(capsules, (3, 6), axis=-1)
    return 0.5 * (starts + ends), 0.5 * np.linalg.norm(ends - starts, axis=-1) + radius[:, 0]


def _least_gap(bounds: Array, gaps: Callable[..., Array]) -> float:
    """Smallest gap, given lower bounds: only gaps that may be the smallest are computed."""
    nearest = np.unravel_index([np.argmin(bounds)], bounds.shape)
    return float(gaps(*np.nonzero(bounds <= max(bounds.min(), gaps(*nearest)[0]) + _ROUNDING_M)).min())


def _gaps(capsules: Array, other_capsules: Array) -> Array:
    """Distances between paired capsules, both (n, 7) [m].

    Source: Ericson 2005, Real-Time Collision Detection, 5.1.9.
    """
    u, v, w = (
        capsules[:, 3:6] - capsules[:, :3],
        other_capsules[:, 3:6] - other_capsules[:, :3],
        capsules[:, :3] - other_capsules[:, :3],
    )
    uu, vv = np.maximum(np.vecdot(u, u), _TINY_M2), np.maximum(np.vecdot(v, v), _TINY_M2)
    uv, uw, vw = np.vecdot(u, v), np.vecdot(u, w), np.vecdot(v, w)
    s = np.clip((uv * vw - uw * vv) / np.maximum(uu * vv - uv**2, _TINY_M2**2), 0, 1)
    t = np.clip((uv * s + vw) / vv, 0, 1)
    s = np.clip((uv * t - uw) / uu, 0, 1)
    return np.asarray(
        np.linalg.norm(w + s[:, None] * u - t[:, None] * v, axis=-1) - capsules[:, 6] - other_capsules[:, 6]
    )
