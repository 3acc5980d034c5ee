"""OpenCV's hand-eye and robot-world calibration from pixels, for comparison."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import ArrayLike

from basecal.geometry import SE3, Array, BoolArray, Camera
from basecal.geometry.rotation import nearest_rotation

_LEAST_AXIS_COSINE = 0.05  # cosine of the largest angle from the optical axis in an undistorted image
_HAND_EYE: Mapping[str, int] = {
    "TSAI": cv2.CALIB_HAND_EYE_TSAI,
    "PARK": cv2.CALIB_HAND_EYE_PARK,
    "HORAUD": cv2.CALIB_HAND_EYE_HORAUD,
    "ANDREFF": cv2.CALIB_HAND_EYE_ANDREFF,
    "DANIILIDIS": cv2.CALIB_HAND_EYE_DANIILIDIS,
}
_ROBOT_WORLD: Mapping[str, int] = {
    "SHAH": cv2.CALIB_ROBOT_WORLD_HAND_EYE_SHAH,
    "LI": cv2.CALIB_ROBOT_WORLD_HAND_EYE_LI,
}
METHODS = (*_HAND_EYE, *_ROBOT_WORLD)
"""The five methods of `calibrateHandEye` and the two of `calibrateRobotWorldHandEye`."""


@dataclass(frozen=True, eq=False)
class RobotWorld:
    """The two unknowns of `outer_i == first @ inner_i @ last`."""

    first: SE3
    last: SE3


def camera_from_target(camera: Camera, points: Array, pixels: Array, visible: BoolArray) -> SE3 | None:
    """Pose of a target in one view by `solvePnP`; None if it fails.

    Args:
        camera: The lens, whose distortion is removed beforehand by our own model.
        points: (p, 3) [m].
        pixels: (p, 2) [px].
        visible: Which points to use, (p,).
    """
    rays, valid = camera.undistort(pixels)
    used = visible & valid & (rays[:, 2] > _LEAST_AXIS_COSINE)
    straight = camera.focal * rays[used, :2] / rays[used, 2:] + camera.center
    try:
        is_solved, rotvec, translation = cv2.solvePnP(points[used], straight, camera.matrix, None)
    except cv2.error:
        return None
    return SE3.from_rotvec(rotvec[:, 0], translation[:, 0]) if is_solved and np.isfinite(rotvec).all() else None


def robot_world(outer: SE3, inner: SE3, method: str = "SHAH") -> RobotWorld | None:
    """Solve for the two unknowns from (n,) poses by one of `METHODS`; None if the method fails.

    OpenCV assumes a camera on a gripper and a fixed world: `cam_from_world == cam_from_gripper @ gripper_from_base @
    base_from_world`. Every chain of one moving transform between two unknowns has this form.
    """
    try:
        result = (_solve_robot_world if method in _ROBOT_WORLD else _solve_hand_eye)(outer, inner, method)
    except (cv2.error, ValueError):
        return None
    is_finite = all(np.all(np.isfinite(each.matrix)) for each in (result.first, result.last))
    return result if is_finite else None


def _solve_robot_world(outer: SE3, inner: SE3, method: str) -> RobotWorld:
    base_turn, base_shift, gripper_turn, gripper_shift = cv2.calibrateRobotWorldHandEye(
        *_lists(outer), *_lists(inner), method=_ROBOT_WORLD[method]
    )
    return RobotWorld(_rigid(gripper_turn, gripper_shift), _rigid(base_turn, base_shift).inverse())


def _solve_hand_eye(outer: SE3, inner: SE3, method: str) -> RobotWorld:
    """Solve by a hand-eye method; `last` is the mean over the views."""
    base_from_gripper = inner.inverse()
    turn, shift = cv2.calibrateHandEye(*_lists(base_from_gripper), *_lists(outer), method=_HAND_EYE[method])
    gripper_from_cam = _rigid(turn, shift)
    last = base_from_gripper @ gripper_from_cam @ outer
    mean = SE3(nearest_rotation(last.rotation.sum(0)), last.translation.mean(0))
    return RobotWorld(gripper_from_cam.inverse(), mean)


def _lists(poses: SE3) -> tuple[list[Array], list[Array]]:
    return list(poses.rotation), list(poses.translation)


def _rigid(rotation: ArrayLike, translation: ArrayLike) -> SE3:
    """Transform with the nearest rotation, since results of TSAI and ANDREFF are not orthogonal.

    Raises:
        ValueError: if the matrix is not finite.
    """
    matrix = np.asarray(rotation, dtype=np.float64)
    if not np.all(np.isfinite(matrix)):
        raise ValueError("no rotation")
    return SE3(nearest_rotation(matrix), np.ravel(translation))
