"""Start values from 3-D points with too few points per view for a pose: touches, and reflectors of a tracker.

In each view, a point carried at one end of the loop coincides with a point carried at the other. The views of each body
(a base or a tracker) determine its tips and marks in its own frame, by linear least squares. Marks shared by two
bodies, and points observed from both sides, place one body after another. Source: Horn 1987 (absolute orientation).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from basecal.estimation.problem.problem import Problem
from basecal.estimation.problem.view_group import End, ViewGroup
from basecal.estimation.start.pair_views import holds_poses, umeyama
from basecal.estimation.view.points import PointMeasurement, is_touch
from basecal.geometry import SE3, Array, IntArray

_RIDGE = 1e-6  # share of an equation: undetermined points stay at the origin of their carrier

Key = tuple[str, int]
"""Key of an unknown point: the name of its mount, and the index of the point."""


@dataclass(frozen=True, eq=False)
class _Side:
    """Points at one end of n views: `rotation @ unknown + offset` in the frame of a body.

    Attributes:
        body: Name of the base, or of the mount of a tracker; None for the world.
        key: The unknown point; None if the points are known.
        rotation: (n, 3, 3).
        offset: (n, 3) [m].
    """

    body: str | None
    key: Key | None
    rotation: Array
    offset: Array

    @property
    def is_mark(self) -> bool:
        """Whether the point is unknown and fixed in the world."""
        return self.body is None and self.key is not None and bool(np.all(self.rotation == np.eye(3)))

    def points(self, positions: Mapping[Key, Array]) -> Array:
        """Points in the body's frame, (n, 3); a point without a position is at the origin of its carrier."""
        return self.offset if self.key is None else self.rotation @ positions.get(self.key, np.zeros(3)) + self.offset


_Meeting = tuple[_Side, _Side]


def has_metric_start(group: ViewGroup, transforms: Mapping[str, SE3]) -> bool:
    """Whether views are touches, or 3-D points without a pose from a static tracker or one with a known mount."""
    eye = group.eye
    if not isinstance(group.measurement, PointMeasurement) or holds_poses(group.measurement):
        return False
    return eye.robot is None or eye.mount in transforms or is_touch(group.measurement)


def place_by_points(problem: Problem, groups: Sequence[ViewGroup], transforms: Mapping[str, SE3]) -> dict[str, SE3]:
    """Transforms from views of 3-D points, by name; undetermined transforms are close to the identity.

    Args:
        problem: The problem.
        groups: Groups of views for which `has_metric_start` holds.
        transforms: Known transforms.
    """
    meetings = [meeting for group in groups for meeting in _meetings(problem, group, transforms)]
    names = list(dict.fromkeys(side.body for meeting in meetings for side in meeting if side.body is not None))
    placed: dict[str | None, SE3] = {None: SE3.identity()}
    placed.update({name: transforms[name] for name in names if name in transforms})
    local = {body: _local_points(meetings, body) for body in (None, *names)}
    while waiting := [name for name in names if name not in placed]:
        marks = {key: pose @ point for body, pose in placed.items() for key, point in local[body].items()}
        pairs = {body: _pairs(meetings, local, placed, marks, body) for body in waiting}
        body = max(pairs, key=lambda name: len(pairs[name][0]))
        placed[body] = _align_points(*pairs[body])
    points = {
        key: placed[body] @ position if _is_mark(meetings, key) else position
        for body, points_of_body in local.items()
        for key, position in points_of_body.items()
    }
    bodies = {name: pose for name, pose in placed.items() if name is not None and name not in transforms}
    return {**bodies, **_mounts(groups, points, transforms)}


def _meetings(problem: Problem, group: ViewGroup, transforms: Mapping[str, SE3]) -> Iterable[_Meeting]:
    """Yield both ends of the views of each point of a group."""
    measurement = group.measurement
    assert isinstance(measurement, PointMeasurement)
    for row, point in enumerate(measurement.points_in_target):
        views = np.flatnonzero(measurement.seen[:, row])
        if len(views):
            seen = measurement.points_in_camera[views, row]
            eye = _side(problem, group.eye, transforms, views, seen, 0, is_camera=True)
            yield eye, _side(problem, group.hand, transforms, views, np.broadcast_to(point, seen.shape), row)


def _side(
    problem: Problem,
    end: End,
    transforms: Mapping[str, SE3],
    views: IntArray,
    points: Array,
    row: int,
    is_camera: bool = False,
) -> _Side:
    """One end of n views of a point, given its positions (n, 3) in the carried frame and its index in the target."""
    base_from_flange, base = end.base_from_flange[views], end.base
    if end.mount in transforms:
        return _Side(base, None, base_from_flange.rotation, base_from_flange @ (transforms[end.mount] @ points))
    if is_camera and end.mount not in problem.point_mounts:
        return _Side(end.mount, None, base_from_flange.rotation, points)
    if end.mount not in problem.point_mounts:
        return _Side(base, (end.mount, row), base_from_flange.rotation, base_from_flange.translation)
    return _Side(base, (end.mount, 0), base_from_flange.rotation, base_from_flange @ points)


def _local_points(meetings: Sequence[_Meeting], body: str | None) -> dict[Key, Array]:
    """Unknown points and marks in a body's frame, (3,) each, from the views of this body alone."""
    own = [
        (a, b)
        for first, second in meetings
        for a, b in ((first, second), (second, first))
        if a.body == body and b.is_mark
    ]
    keys = list(dict.fromkeys(side.key for pair in own for side in pair if side.key is not None))
    information, right = _RIDGE * np.eye(3 * len(keys)), np.zeros(3 * len(keys))
    for a, b in own:
        by_points = np.zeros((len(a.offset), 3, 3 * len(keys)))
        for side, sign in ((a, 1.0), (b, -1.0)):
            if side.key is not None:
                column = 3 * keys.index(side.key)
                by_points[:, :, column : column + 3] += sign * side.rotation
        information += np.einsum("nij,nik->jk", by_points, by_points)
        right -= np.einsum("nij,ni->j", by_points, a.offset - b.offset)
    return dict(zip(keys, np.linalg.solve(information, right).reshape(-1, 3), strict=True))


def _pairs(
    meetings: Sequence[_Meeting],
    local: Mapping[str | None, Mapping[Key, Array]],
    bodies: Mapping[str | None, SE3],
    marks: Mapping[Key, Array],
    body: str | None,
) -> tuple[Array, Array]:
    """Corresponding points in the frame of a body and, from the placed bodies, in the world, (n, 3) each."""
    shared = [key for key in local[body] if key in marks]
    own, world = [local[body][key] for key in shared], [marks[key] for key in shared]
    for first, second in meetings:
        for a, b in ((first, second), (second, first)):
            if a.body == body and b.body in bodies and not b.is_mark:
                own += list(a.points(local[body]))
                world += list(bodies[b.body] @ b.points(local[b.body]))
    return np.array(own).reshape(-1, 3), np.array(world).reshape(-1, 3)


def _align_points(points_in_body: Array, points_in_world: Array) -> SE3:
    """Least-squares `world_from_body` of corresponding points (n, 3); the identity without points."""
    if not len(points_in_body):
        return SE3.identity()
    return umeyama(points_in_body, points_in_world[None], np.ones((1, len(points_in_body))))[0]


def _is_mark(meetings: Sequence[_Meeting], key: Key) -> bool:
    return any(side.key == key and side.is_mark for meeting in meetings for side in meeting)


def _mounts(groups: Sequence[ViewGroup], points: Mapping[Key, Array], transforms: Mapping[str, SE3]) -> dict[str, SE3]:
    """Mounts that carry unknown points; a mount with several points is aligned to all of them."""
    found = {}
    for group in groups:
        measurement = group.measurement
        assert isinstance(measurement, PointMeasurement)
        shapes = {group.eye.mount: np.zeros((1, 3)), group.hand.mount: measurement.points_in_target}
        for name, shape in shapes.items():
            rows = [row for row in range(len(shape)) if (name, row) in points]
            if rows and name not in transforms:
                positions = np.array([points[name, row] for row in rows])
                found[name] = SE3(np.eye(3), positions[0]) if len(shape) == 1 else _align_points(shape[rows], positions)
    return found
