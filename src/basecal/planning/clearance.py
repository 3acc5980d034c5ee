"""How near arms come to one another and to boxes, and how far their points move, on ways straight in joints."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations
from typing import NamedTuple

import numpy as np
from scipy.spatial.distance import cdist

from basecal.cell import CellCamera, CellTarget, KeepOut, Sample
from basecal.errors import InputError
from basecal.geometry import SE3, Array, IntArray
from basecal.kinematics.collision import Capsules, body_capsules, box_capsules
from basecal.planning.sketch import Sketch

_AIR_M = 0.02  # about each arm: as far as its points move from the nearest place on a way that is looked at
_PADDING_M = 0.06  # radius of a link whose body is unknown, and about what an arm carries
_STEP_RAD = 0.05  # between places at which the speed of points is looked at
_CHORD = 1.02  # of an arc of a tenth of a radian and its change of speed over its chord, at most
_STANDING = 2  # frames of an arm, its base and first joint, which stand on what it is mounted on
_PAIRS = 500_000  # of capsules whose distances are in memory at once
_THIRDS = 20  # of a segment that are left out, one after another
_ROUNDING = 1e-9  # of a distance [m]
_TINY = 1e-12  # square of a length that is none [m^2]


@dataclass(frozen=True)
class Clearance:
    """How near a robot comes to another, or to a box.

    Attributes:
        robot: Name of the robot.
        other: Name of the other robot or of the box.
        gap_m: Least distance between them, at places from which no point moves farther than the air about an arm.
        needed_m: The air about both.
    """

    robot: str
    other: str
    gap_m: float
    needed_m: float

    @property
    def is_enough(self) -> bool:
        """Whether they stay apart all the way."""
        return self.gap_m >= self.needed_m


def clearances(sketch: Sketch, start: Sample, end: Sample, moving: Collection[str]) -> Iterator[Clearance]:
    """How near robots come to one another and to boxes to keep out of, on their way to a sample.

    Each goes at a pace of its own: all places on the way of one are held against all on the way of another. Base and
    first joint may be near boxes; robots whose joints are unknown are left out.

    Args:
        sketch: The cell.
        start: Where robots are before.
        end: Where they go.
        moving: Robots that are sent: of others nothing is given but their distances from these.
    """
    ways = {name: way for name in end.robots if (way := _way(sketch, start, end, name)) is not None}
    for one, other in combinations(ways, 2):
        if one in moving or other in moving:
            yield Clearance(one, other, _arms_gap(_swept(*ways[one]), _swept(*ways[other])), 2 * _AIR_M)
    for name in [name for name in ways if name in moving]:
        for box in sketch.cell.keep_out.values():
            yield Clearance(name, box.name, _box_gap(_swept(*ways[name], first=_STANDING), box), _AIR_M)


def path_length(sketch: Sketch, start: Sample, end: Sample, robot: str) -> float | None:
    """By how much the fastest point of a robot moves while its leading joint turns by one radian [m/rad].

    The largest over a straight way in joints, and over links, camera and target; None if joints are not known.
    """
    ends = _ends(sketch, start, end, robot)
    if ends is None:
        return None
    leading = float(np.abs(ends[1] - ends[0]).max())
    if leading == 0:
        return 0.0
    count = int(leading / _STEP_RAD) + 2
    rotation, segments = _placed(sketch, robot, np.linspace(*ends, count))
    turned = np.linalg.norm(np.diff(rotation, axis=0), axis=(-2, -1)) / np.sqrt(2)  # chord of the unit circle
    steps = np.linalg.norm(np.diff(segments, axis=0), axis=-1).max(-1) + turned * robot_capsules(sketch, robot).radius
    return _CHORD * float(steps.max()) * (count - 1) / leading


def _ends(sketch: Sketch, start: Sample, end: Sample, robot: str) -> tuple[Array, Array] | None:
    """Joints at both ends of a way; None of a robot that is sent to poses."""
    here, there = (sample.robots[robot].joints_rad if robot in sample.robots else None for sample in (start, end))
    if here is None or there is None or sketch.cell.robots[robot].chain is None:
        return None
    return here, there


@lru_cache(maxsize=16)
def robot_capsules(sketch: Sketch, robot: str) -> Capsules:
    """Capsules that enclose the links of a robot with joints, and the cameras and targets that it carries.

    A frame without bodies, or with one that cannot be read, has a line from its joint to the next.
    """
    chain = sketch.cell.robots[robot].chain
    assert chain is not None
    parts, problems, lines = list[Capsules](), list[str](), {*range(chain.n + 1)}
    lines -= {body.frame for body in chain.collisions}
    for body in chain.collisions:
        try:
            parts.append(body_capsules(body))
        except InputError as error:
            problems.append(f"link {body.link!r}: {error}")
            lines.add(body.frame)
    steps = [*chain.origins.translation, chain.tip.translation]
    for frame in lines:
        ends = np.stack([np.zeros(3), steps[frame]])[None]
        parts.append(Capsules(np.array([frame]), ends, np.zeros(1), np.array([_PADDING_M])))
    carried: list[CellCamera | CellTarget] = [*sketch.cell.cameras.values(), *sketch.cell.targets.values()]
    for thing in carried:
        if thing.on == robot:
            shape = thing.target if isinstance(thing, CellTarget) else None
            points = np.concatenate([np.zeros((1, 3)), *([] if shape is None else [shape.points])])
            mount = sketch.transforms[sketch.cell.mount_name(thing.name)]
            parts.append(box_capsules(chain.n + 1, mount, np.stack([points.min(0), points.max(0)]), _PADDING_M))
    return Capsules.joined(parts, tuple(problems))


def _placed(sketch: Sketch, robot: str, joints: Array) -> tuple[Array, Array]:
    """Rotations of capsules, (m, k, 3, 3), and their ends in the world, (m, k, 2, 3), at joints, (m, n)."""
    chain, body = sketch.cell.robots[robot].chain, robot_capsules(sketch, robot)
    assert chain is not None
    turning = chain.joint_frames(joints)
    base = sketch.world_from_base(robot)
    frames = [SE3.stack([base] * len(joints)), *(base @ frame for frame in (*turning, turning[-1] @ chain.tip))]
    rotation = np.stack([frame.rotation for frame in frames], axis=1)[:, body.frame]
    places = np.stack([frame.translation for frame in frames], axis=1)[:, body.frame]
    return rotation, body.ends @ rotation.mT + places[:, :, None]


class _Swept(NamedTuple):
    """Segments, (n, 2, 3), and radii, (n,), of capsules of a robot at all places of a way."""

    ends: Array
    radius: Array


def _way(sketch: Sketch, start: Sample, end: Sample, robot: str) -> tuple[Capsules, Array] | None:
    """Capsules of a robot, and their ends at places on its way, (m, k, 2, 3)."""
    ends = _ends(sketch, start, end, robot)
    if ends is None:
        return None
    metres = (path_length(sketch, start, end, robot) or 0.0) * np.abs(ends[1] - ends[0]).max()
    joints = np.linspace(*ends, int(metres / (2 * _AIR_M)) + 2) if metres else ends[0][None]
    return robot_capsules(sketch, robot), _placed(sketch, robot, joints)[1]


def _swept(body: Capsules, ends: Array, first: int = 0) -> _Swept:
    """Capsules at all places of a way, from one frame on."""
    free = body.frame >= first
    return _Swept(ends[:, free].reshape(-1, 2, 3), np.tile((body.radius + body.padding)[free], len(ends)))


def _arms_gap(one: _Swept, other: _Swept) -> float:
    parts = np.array_split(np.arange(len(one.ends)), len(one.ends) * len(other.ends) // _PAIRS + 1)
    return min(_rows_gap(_Swept(one.ends[rows], one.radius[rows]), other) for rows in parts)


def _rows_gap(one: _Swept, other: _Swept) -> float:
    (middles, reach), (other_middles, other_reach) = _balls(one), _balls(other)

    def gap(rows: IntArray, columns: IntArray) -> Array:
        between = _segment_distance(one.ends[rows], other.ends[columns])
        return np.asarray(between - one.radius[rows] - other.radius[columns])

    return _least(cdist(middles, other_middles) - reach[:, None] - other_reach, gap)


def _box_gap(way: _Swept, box: KeepOut) -> float:
    """Least distance of a box; inside it, minus the radius of what is inside."""
    middles, reach = _balls(way)

    def gap(rows: IntArray) -> Array:
        starts, ends = np.moveaxis(way.ends[rows], 1, 0)
        low, high = np.zeros((len(rows), 1)), np.ones((len(rows), 1))
        for _ in range(_THIRDS):  # the distance is convex along a segment
            thirds = low + (high - low) / 3, high - (high - low) / 3
            first, second = (box.distance(starts + share * (ends - starts))[:, None] for share in thirds)
            low, high = np.where(first < second, low, thirds[0]), np.where(first < second, thirds[1], high)
        return np.asarray(box.distance(starts + low * (ends - starts)) - way.radius[rows])

    return _least(box.distance(middles) - reach, gap)


def _balls(way: _Swept) -> tuple[Array, Array]:
    """Middles of balls that enclose capsules, and their radii."""
    starts, ends = way.ends[:, 0], way.ends[:, 1]
    return 0.5 * (starts + ends), 0.5 * np.linalg.norm(ends - starts, axis=-1) + way.radius


def _least(bound: Array, gap: Callable[..., Array]) -> float:
    """Least gap, of which lower bounds are known: only gaps that may be the least are computed."""
    nearest = np.unravel_index([np.argmin(bound)], bound.shape)
    return float(gap(*np.nonzero(bound <= gap(*nearest)[0] + _ROUNDING)).min())


def _segment_distance(one: Array, other: Array) -> Array:
    """Distances of segments, both (n, 2, 3). Source: Ericson 2005, Real-Time Collision Detection, 5.1.9."""
    u, v, w = one[:, 1] - one[:, 0], other[:, 1] - other[:, 0], one[:, 0] - other[:, 0]
    uu, vv = np.maximum(np.vecdot(u, u), _TINY), np.maximum(np.vecdot(v, v), _TINY)
    uv, uw, vw = np.vecdot(u, v), np.vecdot(u, w), np.vecdot(v, w)
    s = np.clip((uv * vw - uw * vv) / np.maximum(uu * vv - uv**2, _TINY**2), 0, 1)
    t = np.clip((uv * s + vw) / vv, 0, 1)
    s = np.clip((uv * t - uw) / uu, 0, 1)
    return np.asarray(np.linalg.norm(w + s[:, None] * u - t[:, None] * v, axis=-1))
