"""OpenCV's own way from pixels to a robot's place in the world, to compare with."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from basecal.geometry import SE3, Array, BoolArray, Camera

_LEAST_AXIS_COSINE = 0.05  # cosine of the angle from the axis, of what a flat image can hold


@dataclass(frozen=True, eq=False)
class RobotWorld:
    """The two unknowns of `outer_i == first @ inner_i @ last`."""

    first: SE3
    last: SE3


def camera_from_target(camera: Camera, points: Array, pixels: Array, visible: BoolArray) -> SE3 | None:
    """The pose of a target in one view by `solvePnP`; None if it finds none.

    Args:
        camera: The lens, whose distortion is taken out beforehand by our own model.
        points: (p, 3) [m].
        pixels: (p, 2) [px].
        visible: (p,) which of them.
    """
    fx, fy, cx, cy = camera.parameters[:4]
    matrix = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1.0]])
    rays, valid = camera.undistort(pixels)
    used = visible & valid & (rays[:, 2] > _LEAST_AXIS_COSINE)
    straight = camera.focal * rays[used, :2] / rays[used, 2:] + camera.center
    try:
        found, turn, shift = cv2.solvePnP(points[used], straight, matrix, None)
    except cv2.error:
        return None
    return SE3.from_rotvec(turn[:, 0], shift[:, 0]) if found and np.isfinite(turn).all() else None


def robot_world(outer: SE3, inner: SE3) -> RobotWorld | None:
    """`calibrateRobotWorldHandEye` (the method of Shah) of (n,) poses; None if it finds nothing.

    OpenCV has a camera on a gripper and a world that stands: `cam_from_world == cam_from_gripper @
    gripper_from_base @ base_from_world`. Any other chain of one moving transform between two unknowns is that one too.
    """
    given = [(*pose.rotation,) for pose in (outer, inner)], [(*pose.translation,) for pose in (outer, inner)]
    (outer_turns, inner_turns), (outer_shifts, inner_shifts) = given
    try:
        base_turn, base_shift, gripper_turn, gripper_shift = cv2.calibrateRobotWorldHandEye(
            outer_turns, outer_shifts, inner_turns, inner_shifts
        )
        world_from_base = SE3.from_matrix(_matrix(base_turn, base_shift))
        cam_from_gripper = SE3.from_matrix(_matrix(gripper_turn, gripper_shift))
    except (cv2.error, ValueError):
        return None
    return RobotWorld(cam_from_gripper, world_from_base.inverse())


def _matrix(turn: Array, shift: Array) -> Array:
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = turn, shift[:, 0]
    return matrix
