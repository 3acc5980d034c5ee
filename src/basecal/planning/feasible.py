"""Feasibility of a sample: joint limits, visibility and collisions."""

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

_MARGIN_SHARE = 0.05  # of the image's width: effect of an error of one or two degrees in a guess
_LEAST_FACING_COSINE = 0.35  # between a board's normal and the ray, at least: at smaller values corners merge
_FARTHEST_M = 3.0
_LEAST_JOINTS = 6  # of an arm that reaches a general pose; with fewer joints it moves to the nearest one
_INVERSE_STEPS = 40  # iterations of batched inverse kinematics: poses near the start converge in fewer
_REACH_TOLERANCE = 1e-8  # [m, rad] residual of a converged item of batched inverse kinematics
_LEAST_AXIS_COSINE = 0.9  # between a point's ray and the camera's axis, at least: half the view of depth cameras


def is_feasible(sketch: Sketch, sample: Sample) -> bool:
    """Whether a sample is within joint limits, shows the target and is free of collision."""
    return all(test(sketch, sample) for test in (is_within_limits, is_in_view, is_clear))


def is_within_limits(sketch: Sketch, sample: Sample) -> bool:
    """Whether every joint is within its limits; for robots sent to poses, only the controller checks the limits."""
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


def with_seen_distances(sketch: Sketch, taught_states: Sequence[Mapping[str, RobotState]]) -> Sketch:
    """The sketch with `nearest_m` lowered to the smallest depth of the target at taught poses that show it.

    Args:
        sketch: Sketch of the cell.
        taught_states: States of all robots at taught poses.
    """
    camera_from_target = SE3.stack(
        [sketch.camera_from_target(Sample(0, robots=dict(states))) for states in taught_states]
    )
    is_seen = visibility_mask(replace(sketch, nearest_m=0.0), camera_from_target)
    rotated: Array = sketch.target_points @ camera_from_target.rotation.mT
    depth = (rotated + camera_from_target.translation[:, None])[is_seen, :, 2]
    return replace(sketch, nearest_m=float(min(sketch.nearest_m, depth.min(initial=np.inf))))


def visibility_mask(sketch: Sketch, camera_from_target: SE3) -> BoolArray:
    """Which poses of the target in the camera, (n,), satisfy `is_in_view`; without a lens, those near its axis."""
    rotated: Array = sketch.target_points @ camera_from_target.rotation.mT
    in_camera = rotated + camera_from_target.translation[:, None]
    depth = in_camera[..., 2]
    is_seen: BoolArray = np.all((depth > sketch.nearest_m) & (depth < _FARTHEST_M), axis=-1)
    if sketch.camera.intrinsics is None:
        is_seen &= np.all(depth > _LEAST_AXIS_COSINE * np.linalg.norm(in_camera, axis=-1), axis=-1)
    else:
        width = sketch.lens.size_px[0] if sketch.lens.size_px else 0
        is_seen &= np.all(points_in_image(sketch.lens, in_camera, _MARGIN_SHARE * width), axis=-1)
    shape = sketch.target.target
    if shape is not None and shape.sheets:
        normal = camera_from_target.rotation @ shape.sheets[0].target_from_sheet.rotation[:, 2]
        is_seen &= is_front_seen(normal, in_camera.mean(1), _LEAST_FACING_COSINE)
    return is_seen


def points_in_image(camera: Camera, points_in_camera: Array, margin_px: float) -> BoolArray:
    """Which points, (..., 3) [m], are imaged at least `margin_px` inside the image border, (...,)."""
    is_seen: BoolArray = camera.sees(points_in_camera)
    if camera.size_px is None:
        return is_seen
    pixels = camera.project(points_in_camera)
    inside = (pixels >= margin_px) & (pixels <= np.array(camera.size_px) - 1 - margin_px)
    is_seen &= np.all(inside, axis=-1)
    return is_seen


def is_front_seen(normal: Array, centre: Array, least_cosine: float) -> BoolArray:
    """Which boards show their front, (n,), from normals out of their back, (n, 3), and centres, (n, 3) [m]."""
    return np.asarray(np.vecdot(normal, centre) > least_cosine * np.linalg.norm(centre, axis=-1))


def is_clear(sketch: Sketch, sample: Sample) -> bool:
    """Whether each robot with its load keeps its clearance to other robots and to keep-out boxes."""
    return is_path_clear(sketch, sample, sample)


def is_path_clear(sketch: Sketch, start: Sample, end: Sample) -> bool:
    """Whether arms keep their clearance to one another and to keep-out boxes on a path straight in joint space."""
    return all(each.is_enough for each in clearances(sketch, start, end, end.robots))


def blocked_samples(sketch: Sketch, home: Mapping[str, RobotState], samples: Sequence[Sample]) -> list[int]:
    """Numbers of samples whose path from the previous sample, or from `home` for the first, is not clear."""
    stops = [Sample(0, robots=dict(home)), *samples]
    return [end.sample for start, end in pairwise(stops) if not is_path_clear(sketch, start, end)]


def reach_pose(robot: Robot, base_from_flange: SE3, neighbour: RobotState) -> RobotState | None:
    """Robot state near a neighbour that reaches a flange pose; None if the pose is out of reach.

    Args:
        robot: The robot.
        base_from_flange: Goal of the flange.
        neighbour: State that starts the inverse kinematics; if it has no joints, the goal itself is returned.
    """
    if neighbour.joints_rad is None or robot.chain is None:
        return RobotState(base_from_flange)
    try:
        return RobotState(joints_rad=inverse(robot.chain, base_from_flange, neighbour.joints_rad))
    except NotConverged:
        return None


def approach_poses(robot: Robot, base_from_flange: SE3, neighbours: Sequence[RobotState]) -> list[RobotState | None]:
    """Robot states as from `reach_poses`; an arm with fewer than six joints moves as near to each pose as it can."""
    has_few_joints = robot.chain is not None and robot.chain.n < _LEAST_JOINTS
    return reach_poses(robot, base_from_flange, neighbours, np.inf if has_few_joints else _REACH_TOLERANCE)


def reach_poses(
    robot: Robot, base_from_flange: SE3, neighbours: Sequence[RobotState], tolerance: float = _REACH_TOLERANCE
) -> list[RobotState | None]:
    """Robot states near neighbours that reach flange poses, (n,); None for each pose out of reach.

    Args:
        robot: The robot.
        base_from_flange: Goals of the flange, (n,).
        neighbours: States that start the inverse kinematics, one per goal; without joints, the goals are returned.
        tolerance: Largest residual of the flange pose [m, rad].
    """
    start = [state.joints_rad for state in neighbours if state.joints_rad is not None]
    if robot.chain is None or len(start) < len(neighbours) or not start:
        return [RobotState(base_from_flange[k]) for k in range(len(neighbours))]
    try:
        joints = inverse(robot.chain, base_from_flange, np.stack(start), iterations=_INVERSE_STEPS)
    except NotConverged as error:
        joints = np.asarray(error.state)
    residual = np.abs((robot.chain.forward(joints).inverse() @ base_from_flange).log()).max(-1)
    return [RobotState(joints_rad=q) if error < tolerance else None for q, error in zip(joints, residual, strict=True)]
