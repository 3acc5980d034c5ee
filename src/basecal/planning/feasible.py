"""Whether a sample can be taken: within the arms' limits, in view, and free of collision."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise

import numpy as np

from basecal.cell import RobotState, Sample
from basecal.geometry import SE3, Array, BoolArray
from basecal.planning.sketch import Sketch

Feasible = Callable[[Sample], bool]

_MARGIN = 0.05  # of the image's width: what guesses of a degree or two are off by
_FACING = 0.35  # cosine of a board to the ray, at least: flatter, its corners run together
_NEAREST_M, _FARTHEST_M = 0.2, 3.0
_NEAR_AXIS = 0.9  # cosine of a point's ray to the camera's axis, at least: half of what depth cameras look at
_CLEAR_M = 0.16  # between the middles of two arms' links: twice the radius of a link, and some air
_STEP_M = 0.05  # between points on a link
_STEP_RAD = 0.1  # between places on a way: a link of half a metre moves by its points' distance
_ROUNDING = 1e-6  # of a link's length in steps: a link has as many points in every posture
_CHORD = 1.02  # of an arc of a tenth of a radian and its change of speed over its chord, at most
_LINK_M = 0.08  # radius of a link, and some air
_STANDING = 2  # corners of an arm's middle line, its base and first joint, which stand on what it is mounted on


def feasible_in(sketch: Sketch) -> Feasible:
    """Whether a sample of a cell can be taken, by all that is known of it."""
    tests = (within_limits, in_view, is_clear, keeps_out)
    return lambda sample: all(test(sketch, sample) for test in tests)


def within_limits(sketch: Sketch, sample: Sample) -> bool:
    """Whether every joint is within its limits; robots that are sent to poses keep theirs themselves."""
    for name, state in sample.robots.items():
        chain = sketch.cell.robots[name].chain
        if chain is not None and state.joints_rad is not None:
            inside = (state.joints_rad >= chain.lower) & (state.joints_rad <= chain.upper)
            if not inside.all():
                return False
    return True


def in_view(sketch: Sketch, sample: Sample) -> bool:
    """Whether the whole target is in the picture, with a margin, and shows its front."""
    return bool(seen_whole(sketch, SE3.stack([sketch.camera_from_target(sample)]))[0])


def seen_whole(sketch: Sketch, camera_from_target: SE3) -> BoolArray:
    """As `in_view`, of many poses of the target, (n,); of a camera without a lens, near its axis."""
    points = np.zeros((1, 3)) if sketch.target.target is None else sketch.target.target.points
    turned: Array = points @ camera_from_target.rotation.mT
    in_camera = turned + camera_from_target.translation[:, None]
    depth = in_camera[..., 2]
    seen: BoolArray = np.all((depth > _NEAREST_M) & (depth < _FARTHEST_M), axis=-1)
    if sketch.camera.intrinsics is None:
        seen &= np.all(depth > _NEAR_AXIS * np.linalg.norm(in_camera, axis=-1), axis=-1)
    else:
        seen &= _in_picture(sketch, in_camera)
    shape = sketch.target.target
    if shape is not None and shape.sheets:
        normal = camera_from_target.rotation @ shape.sheets[0].target_from_sheet.rotation[:, 2]
        centre = in_camera.mean(1)
        seen &= np.einsum("ni,ni->n", normal, centre) > _FACING * np.linalg.norm(centre, axis=-1)
    return seen


def _in_picture(sketch: Sketch, in_camera: Array) -> BoolArray:
    """Whether all points, (n, p, 3), are in the picture, (n,)."""
    lens = sketch.lens
    seen: BoolArray = np.all(lens.sees(in_camera), axis=-1)
    if lens.size_px is None:
        return seen
    margin = _MARGIN * lens.size_px[0]
    pixels = lens.project(in_camera)
    inside: BoolArray = np.all((pixels >= margin) & (pixels <= np.array(lens.size_px) - 1 - margin), axis=(-1, -2))
    return seen & inside


def is_clear(sketch: Sketch, sample: Sample) -> bool:
    """Whether no link, camera or target of one robot is near one of another; robots without a chain are not looked at.

    Camera and target are on purpose near one another: they count as what they hang on.
    """
    return _are_apart([points for name in sample.robots if (points := _body(sketch, sample, name)) is not None])


def keeps_out(sketch: Sketch, sample: Sample) -> bool:
    """Whether no arm, nor what it carries, is in or near a box that the cell keeps out of."""
    return not any(boxes_on_way(sketch, sample, sample, name) for name in sample.robots)


def boxes_on_way(sketch: Sketch, start: Sample, end: Sample, robot: str) -> list[str]:
    """Names of the boxes that a robot comes into or near on a straight way in joints; base and first joint may."""
    points = _swept(sketch, start, end, robot, first=_STANDING) if sketch.cell.keep_out else None
    if points is None:
        return []
    return [name for name, box in sketch.cell.keep_out.items() if box.distance(points).min() < _LINK_M]


def path_length(sketch: Sketch, start: Sample, end: Sample, robot: str) -> float | None:
    """By how much the fastest point of a robot moves while its leading joint turns by one radian [m/rad].

    The largest over a straight way in joints, and over points of links, camera and target; None of a robot that is
    sent to poses.
    """
    places = _places(start, end, robot)
    if places is None:
        return None
    leading = float(np.abs(places[-1] - places[0]).max())
    if leading == 0:
        return 0.0
    bodies = [_body(sketch, _at(end, robot, q), robot) for q in np.linspace(places[0], places[-1], 2 * len(places))]
    points = np.stack([body for body in bodies if body is not None])
    steps = np.linalg.norm(np.diff(points, axis=0), axis=-1)
    return _CHORD * float(steps.max()) * (len(points) - 1) / leading


def way_is_clear(sketch: Sketch, start: Sample, end: Sample) -> bool:
    """Whether arms that go straight from joints to joints stay clear of one another, and of boxes to keep out of.

    Each goes at a pace of its own: all places on the way of one are held against all on the way of another.
    """
    if any(boxes_on_way(sketch, start, end, name) for name in end.robots):
        return False
    ways = [points for name in end.robots if (points := _swept(sketch, start, end, name)) is not None]
    return _are_apart(ways)


def unclear_ways(sketch: Sketch, home: Mapping[str, RobotState], samples: Sequence[Sample]) -> list[int]:
    """Numbers of samples to which the way from the one before, the first from `home`, is not clear."""
    at = [Sample(0, robots=dict(home)), *samples]
    return [end.sample for start, end in pairwise(at) if not way_is_clear(sketch, start, end)]


def _are_apart(bodies: Sequence[Array]) -> bool:
    for place, one in enumerate(bodies):
        for other in bodies[place + 1 :]:
            if np.linalg.norm(one[:, None] - other[None], axis=-1).min() < _CLEAR_M:
                return False
    return True


def _swept(sketch: Sketch, start: Sample, end: Sample, robot: str, first: int = 0) -> Array | None:
    """Points of a robot and what it carries on its way, (n, 3); None of one that is sent to poses."""
    places = _places(start, end, robot)
    if places is None:
        return None
    found = [points for q in places if (points := _body(sketch, _at(end, robot, q), robot, first)) is not None]
    return np.concatenate(found) if found else None


def _places(start: Sample, end: Sample, robot: str) -> Array | None:
    """Joints along a straight way, (n, joints); None of a robot that is sent to poses."""
    here, there = (sample.robots[robot].joints_rad if robot in sample.robots else None for sample in (start, end))
    if here is None or there is None:
        return None
    return np.linspace(here, there, int(np.abs(there - here).max() / _STEP_RAD) + 2)


def _at(sample: Sample, robot: str, joints: Array) -> Sample:
    return Sample(0, robots={**sample.robots, robot: RobotState(joints_rad=joints)})


def _body(sketch: Sketch, sample: Sample, robot: str, first: int = 0) -> Array | None:
    """Points along the links of a robot, from one of its corners on, and of what it carries, in the world, (n, 3)."""
    chain, state = sketch.cell.robots[robot].chain, sample.robots[robot]
    if chain is None or state.joints_rad is None:
        return None
    frames = [*(frame.translation for frame in chain.joint_frames(state.joints_rad))]
    corners = [np.zeros(3), *frames, chain.forward(state.joints_rad).translation][first:]
    counts = [int(np.linalg.norm(b - a) / _STEP_M + _ROUNDING) + 2 for a, b in pairwise(corners)]
    links = [np.linspace(a, b, count) for (a, b), count in zip(pairwise(corners), counts, strict=True)]
    points = sketch.world_from_base(robot) @ np.concatenate(links)
    things = [thing for thing in (sketch.camera, sketch.target) if thing.on == robot]
    carried = [sketch.world_from(thing.name, sample.robots) for thing in things]
    shape = sketch.target.target
    if shape is not None and sketch.target.on == robot:
        points = np.concatenate([points, sketch.world_from(sketch.target.name, sample.robots) @ shape.points])
    return np.concatenate([points, *(pose.translation[None] for pose in carried)])
