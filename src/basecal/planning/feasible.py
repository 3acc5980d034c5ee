"""Whether a sample can be taken: within the arms' limits, in view, and free of collision."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from basecal.cell import Robot, RobotState, Sample
from basecal.errors import NotConverged
from basecal.geometry import SE3, Array, BoolArray, Camera
from basecal.kinematics.inverse import inverse
from basecal.planning.clearance import clearances
from basecal.planning.sketch import Sketch

_MARGIN_SHARE = 0.05  # of the image's width: what guesses of a degree or two are off by
_LEAST_FACING_COSINE = 0.35  # cosine of a board to the ray, at least: flatter, its corners run together
_FARTHEST_M = 3.0
_LEAST_JOINTS = 6  # of an arm that can be sent to any pose; with fewer it goes to the nearest one
_INVERSE_STEPS = 40  # of many inverses at most: what is farther than a taught pose is from this one is not reached
_REACH_TOLERANCE = 1e-8  # [m, rad] of inverses that did not converge everywhere, where they did
_LEAST_AXIS_COSINE = 0.9  # cosine of a point's ray to the camera's axis, at least: half of what depth cameras look at


def is_feasible(sketch: Sketch, sample: Sample) -> bool:
    """Whether a sample of a cell can be taken, by all that is known of it."""
    return all(test(sketch, sample) for test in (is_within_limits, is_in_view, is_clear))


def is_within_limits(sketch: Sketch, sample: Sample) -> bool:
    """Whether every joint is within its limits; robots that are sent to poses keep theirs themselves."""
    for name, state in sample.robots.items():
        chain = sketch.cell.robots[name].chain
        if chain is not None and state.joints_rad is not None:
            inside = (state.joints_rad >= chain.lower) & (state.joints_rad <= chain.upper)
            if not inside.all():
                return False
    return True


def is_in_view(sketch: Sketch, sample: Sample) -> bool:
    """Whether the whole target is in the image, with a margin, and shows its front."""
    return bool(visibility_mask(sketch, SE3.stack([sketch.camera_from_target(sample)]))[0])


def as_near_as_seen(sketch: Sketch, views: Sequence[Mapping[str, RobotState]]) -> Sketch:
    """The sketch, with targets allowed as near as they are in these views, where they are in the image.

    Args:
        sketch: What is known of the cell.
        views: States of all robots, such as taught ones.
    """
    looked = SE3.stack([sketch.camera_from_target(Sample(0, robots=dict(view))) for view in views])
    seen = visibility_mask(replace(sketch, nearest_m=0.0), looked)
    depth = ((sketch.target_points @ looked.rotation.mT) + looked.translation[:, None])[seen, :, 2]
    return replace(sketch, nearest_m=float(min(sketch.nearest_m, depth.min(initial=np.inf))))


def visibility_mask(sketch: Sketch, camera_from_target: SE3) -> BoolArray:
    """As `is_in_view`, of many poses of the target, (n,); of a camera without a lens, near its axis."""
    turned: Array = sketch.target_points @ camera_from_target.rotation.mT
    in_camera = turned + camera_from_target.translation[:, None]
    depth = in_camera[..., 2]
    seen: BoolArray = np.all((depth > sketch.nearest_m) & (depth < _FARTHEST_M), axis=-1)
    if sketch.camera.intrinsics is None:
        seen &= np.all(depth > _LEAST_AXIS_COSINE * np.linalg.norm(in_camera, axis=-1), axis=-1)
    else:
        width = sketch.lens.size_px[0] if sketch.lens.size_px else 0
        seen &= np.all(points_in_image(sketch.lens, in_camera, _MARGIN_SHARE * width), axis=-1)
    shape = sketch.target.target
    if shape is not None and shape.sheets:
        normal = camera_from_target.rotation @ shape.sheets[0].target_from_sheet.rotation[:, 2]
        seen &= is_front_seen(normal, in_camera.mean(1), _LEAST_FACING_COSINE)
    return seen


def points_in_image(camera: Camera, points_in_camera: Array, margin_px: float) -> BoolArray:
    """Which points, (..., 3) [m], have an image at least `margin_px` within its border, (...,)."""
    seen: BoolArray = camera.sees(points_in_camera)
    if camera.size_px is None:
        return seen
    pixels = camera.project(points_in_camera)
    inside = (pixels >= margin_px) & (pixels <= np.array(camera.size_px) - 1 - margin_px)
    seen &= np.all(inside, axis=-1)
    return seen


def is_front_seen(normal: Array, centre: Array, least_cosine: float) -> BoolArray:
    """Whether boards about centres, (n, 3) [m], show their fronts, by directions, (n, 3), that point through them."""
    return np.asarray(np.vecdot(normal, centre) > least_cosine * np.linalg.norm(centre, axis=-1))


def is_clear(sketch: Sketch, sample: Sample) -> bool:
    """Whether no robot, nor what it carries, is near another one or a box that the cell keeps out of."""
    return is_path_clear(sketch, sample, sample)


def is_path_clear(sketch: Sketch, start: Sample, end: Sample) -> bool:
    """Whether arms that go straight from joints to joints stay clear of one another, and of boxes to keep out of."""
    return all(each.is_enough for each in clearances(sketch, start, end, end.robots))


def blocked_samples(sketch: Sketch, home: Mapping[str, RobotState], samples: Sequence[Sample]) -> list[int]:
    """Numbers of samples to which the way from the one before, the first from `home`, is not clear."""
    at = [Sample(0, robots=dict(home)), *samples]
    return [end.sample for start, end in pairwise(at) if not is_path_clear(sketch, start, end)]


def reach_pose(robot: Robot, base_from_flange: SE3, neighbour: RobotState) -> RobotState | None:
    """The state near another one that brings the flange there; None if the arm does not reach.

    Args:
        robot: The robot.
        base_from_flange: Where to.
        neighbour: In the kind that the robot is sent by: joints, or a pose, which is taken as it is.
    """
    if neighbour.joints_rad is None or robot.chain is None:
        return RobotState(base_from_flange)
    try:
        return RobotState(joints_rad=inverse(robot.chain, base_from_flange, neighbour.joints_rad))
    except NotConverged:
        return None


def approach_poses(robot: Robot, base_from_flange: SE3, neighbours: Sequence[RobotState]) -> list[RobotState | None]:
    """As `reach_poses`; but an arm of fewer than six joints, which reaches hardly any pose, goes as near as it can."""
    has_few_joints = robot.chain is not None and robot.chain.n < _LEAST_JOINTS
    return reach_poses(robot, base_from_flange, neighbours, np.inf if has_few_joints else _REACH_TOLERANCE)


def reach_poses(
    robot: Robot, base_from_flange: SE3, neighbours: Sequence[RobotState], tolerance: float = _REACH_TOLERANCE
) -> list[RobotState | None]:
    """States near others that bring the flange to poses (n,), side by side; None where the arm does not reach.

    Args:
        robot: The robot.
        base_from_flange: Where to, (n,).
        neighbours: One for each: joints, or poses, which are taken as they are.
        tolerance: How far the flange may stay away [m, rad].
    """
    start = [state.joints_rad for state in neighbours if state.joints_rad is not None]
    if robot.chain is None or len(start) < len(neighbours) or not start:
        return [RobotState(base_from_flange[k]) for k in range(len(neighbours))]
    try:
        found = inverse(robot.chain, base_from_flange, np.stack(start), iterations=_INVERSE_STEPS)
    except NotConverged as error:
        found = np.asarray(error.state)
    left = np.abs((robot.chain.forward(found).inverse() @ base_from_flange).log()).max(-1)
    return [RobotState(joints_rad=q) if off < tolerance else None for q, off in zip(found, left, strict=True)]
