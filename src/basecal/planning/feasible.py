"""Whether a sample can be taken: within the arms' limits, in view, and free of collision."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np

from basecal.cell import WORLD, Sample
from basecal.geometry import Array
from basecal.planning.sketch import Sketch

Feasible = Callable[[Sample], bool]

_MARGIN = 0.05  # of the image's width: what guesses of a degree or two are off by
_FACING = 0.35  # cosine of a board to the ray, at least: flatter, its corners run together
_NEAREST_M, _FARTHEST_M = 0.2, 3.0
_CLEAR_M = 0.16  # between the middles of two arms' links: twice the radius of a link, and some air
_STEP_M = 0.05  # between points on a link


def feasible_in(sketch: Sketch) -> Feasible:
    """Whether a sample of a cell can be taken, by all that is known of it."""
    tests = (within_limits, in_view, is_clear)
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
    shape, lens = sketch.target.target, sketch.lens
    points = np.zeros((1, 3)) if shape is None else shape.points
    seen = sketch.camera_from_target(sample)
    in_camera = seen @ points
    depth = in_camera[:, 2]
    if not np.all((depth > _NEAREST_M) & (depth < _FARTHEST_M) & lens.sees(in_camera)):
        return False
    if lens.size_px is not None:
        margin = _MARGIN * lens.size_px[0]
        pixels = lens.project(in_camera)
        if not np.all((pixels >= margin) & (pixels <= np.array(lens.size_px) - 1 - margin)):
            return False
    if shape is None or not shape.sheets:
        return True
    normal = seen.rotation @ shape.sheets[0].target_from_sheet.rotation[:, 2]
    centre = in_camera.mean(0)
    return bool(normal @ centre > _FACING * np.linalg.norm(centre))


def is_clear(sketch: Sketch, sample: Sample) -> bool:
    """Whether no link, camera or target of one robot is near one of another; robots without a chain are not looked at.

    Camera and target are on purpose near one another: they count as what they hang on.
    """
    bodies = [points for name in sample.robots if (points := _body(sketch, sample, name)) is not None]
    for place, one in enumerate(bodies):
        for other in bodies[place + 1 :]:
            if np.linalg.norm(one[:, None] - other[None], axis=-1).min() < _CLEAR_M:
                return False
    return True


def _body(sketch: Sketch, sample: Sample, robot: str) -> Array | None:
    """Points along the links of a robot, and of what it carries, in the world, (n, 3)."""
    chain, state = sketch.cell.robots[robot].chain, sample.robots[robot]
    if chain is None or state.joints_rad is None:
        return None
    frames = [*(frame.translation for frame in chain.joint_frames(state.joints_rad))]
    corners = [np.zeros(3), *frames, chain.forward(state.joints_rad).translation]
    points = sketch.world_from_base(robot) @ np.concatenate([_along(a, b) for a, b in pairwise(corners)])
    carried = [sketch.world_from(name, sample.robots) for name in sketch.view if _carrier(sketch, name) == robot]
    shape = sketch.target.target
    if shape is not None and sketch.target.on == robot:
        points = np.concatenate([points, sketch.world_from(sketch.target.name, sample.robots) @ shape.points])
    return np.concatenate([points, *(pose.translation[None] for pose in carried)])


def _carrier(sketch: Sketch, name: str) -> str:
    thing = sketch.cell.cameras.get(name) or sketch.cell.targets[name]
    return thing.on if thing.on != WORLD else ""


def _along(start: Array, end: Array) -> Array:
    count = int(np.linalg.norm(end - start) / _STEP_M) + 2
    return np.asarray(np.linspace(start, end, count))
