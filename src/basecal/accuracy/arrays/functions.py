"""Calibrations from arrays with the signatures of OpenCV, which add covariance, a verdict and findings."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

from numpy.typing import ArrayLike

from basecal.accuracy.arrays.array_calibration import Alias, ArrayCalibration
from basecal.accuracy.arrays.words import BASE_TO_BASE_WORDS, HAND_EYE_WORDS, ROBOT_WORLD_WORDS
from basecal.accuracy.calibrate import calibrate
from basecal.cell import WORLD, Cell, CellCamera, CellTarget, PoseObservation, Recording, Robot, RobotState, Sample
from basecal.errors import check_choice
from basecal.estimation.settings import DEFAULT, Settings
from basecal.exchange.importers.arrays import record_of_arrays
from basecal.exchange.importing.hand_eye import HandEyeRecord


def hand_eye(
    R_gripper2base: ArrayLike,
    t_gripper2base: ArrayLike,
    R_target2cam: ArrayLike,
    t_target2cam: ArrayLike,
    *,
    camera_on: Literal["robot", "world"] = "robot",
    settings: Settings = DEFAULT,
) -> ArrayCalibration:
    """Estimate `cam2gripper` and `target2base`, as `cv2.calibrateHandEye`.

    With a static camera, estimate `cam2base` and `target2gripper`.

    Args:
        R_gripper2base: (n, 3, 3), or rotation vectors (n, 3) [rad]; arrays or lists of arrays.
        t_gripper2base: (n, 3) or (n, 3, 1) [m].
        R_target2cam: (n, 3, 3), or rotation vectors (n, 3) [rad].
        t_target2cam: (n, 3) or (n, 3, 1) [m].
        camera_on: Whether the robot or the world carries the camera. The gripper poses are not inverted in either case.
        settings: Settings of the solver.

    Raises:
        InputError: if the arrays are no poses or differ in number, or `camera_on` is unknown.
    """
    arrays = {
        "R_gripper2base": R_gripper2base,
        "t_gripper2base": t_gripper2base,
        "R_target2cam": R_target2cam,
        "t_target2cam": t_target2cam,
    }
    check_choice("camera_on", camera_on, ("robot", "world"))
    record = record_of_arrays(arrays, "hand_eye", camera_on == "robot")
    if camera_on == "robot":
        names = {"cam2gripper": Alias("eye_flange_from_camera"), "target2base": Alias("eye_base_from_target")}
    else:
        names = {"cam2base": Alias("hand_base_from_camera"), "target2gripper": Alias("hand_flange_from_target")}
    return _calibrate_record(record, names, HAND_EYE_WORDS, settings)


def robot_world(
    R_world2cam: ArrayLike,
    t_world2cam: ArrayLike,
    R_base2gripper: ArrayLike,
    t_base2gripper: ArrayLike,
    *,
    settings: Settings = DEFAULT,
) -> ArrayCalibration:
    """Estimate `base2world` and `gripper2cam`, as `cv2.calibrateRobotWorldHandEye`.

    Args:
        R_world2cam: (n, 3, 3), or rotation vectors (n, 3) [rad]; arrays or lists of arrays.
        t_world2cam: (n, 3) or (n, 3, 1) [m].
        R_base2gripper: (n, 3, 3), or rotation vectors (n, 3) [rad].
        t_base2gripper: (n, 3) or (n, 3, 1) [m].
        settings: Settings of the solver.

    Raises:
        InputError: if the arrays are no poses or differ in number.
    """
    arrays = {
        "R_world2cam": R_world2cam,
        "t_world2cam": t_world2cam,
        "R_base2gripper": R_base2gripper,
        "t_base2gripper": t_base2gripper,
    }
    names = {"base2world": Alias("eye_base_from_target", True), "gripper2cam": Alias("eye_flange_from_camera", True)}
    return _calibrate_record(record_of_arrays(arrays, "robot_world"), names, ROBOT_WORLD_WORDS, settings)


def base_to_base(
    R_eye_gripper2base: ArrayLike,
    t_eye_gripper2base: ArrayLike,
    R_hand_gripper2base: ArrayLike,
    t_hand_gripper2base: ArrayLike,
    R_target2cam: ArrayLike,
    t_target2cam: ArrayLike,
    *,
    settings: Settings = DEFAULT,
) -> ArrayCalibration:
    """Estimate `hand_base2eye_base`, `cam2eye_gripper` and `target2hand_gripper` of two arms that may both move.

    Args:
        R_eye_gripper2base: Of the arm with the camera, (n, 3, 3), or rotation vectors (n, 3) [rad].
        t_eye_gripper2base: Of the arm with the camera, (n, 3) or (n, 3, 1) [m].
        R_hand_gripper2base: Of the arm with the target, (n, 3, 3), or rotation vectors (n, 3) [rad].
        t_hand_gripper2base: Of the arm with the target, (n, 3) or (n, 3, 1) [m].
        R_target2cam: (n, 3, 3), or rotation vectors (n, 3) [rad].
        t_target2cam: (n, 3) or (n, 3, 1) [m].
        settings: Settings of the solver.

    Raises:
        InputError: if the arrays are no poses or differ in number.
    """
    arrays = {
        "R_eye_gripper2base": R_eye_gripper2base,
        "t_eye_gripper2base": t_eye_gripper2base,
        "R_hand_gripper2base": R_hand_gripper2base,
        "t_hand_gripper2base": t_hand_gripper2base,
        "R_target2cam": R_target2cam,
        "t_target2cam": t_target2cam,
    }
    names = {
        "hand_base2eye_base": Alias("eye_base_from_hand_base"),
        "cam2eye_gripper": Alias("eye_flange_from_camera"),
        "target2hand_gripper": Alias("hand_flange_from_target"),
    }
    return _calibrate_record(record_of_arrays(arrays, "base_to_base"), names, BASE_TO_BASE_WORDS, settings)


def _calibrate_record(
    record: HandEyeRecord, names: Mapping[str, Alias], words: Mapping[str, str], settings: Settings
) -> ArrayCalibration:
    """Calibrate a record as a cell in which `eye` carries the camera and `hand` the target."""
    poses = {"eye": record.base_from_flange} if record.camera_on_robot else {"hand": record.base_from_flange}
    if record.hand_base_from_flange is not None:
        poses["hand"] = record.hand_base_from_flange
    carriers = [name if name in poses else WORLD for name in ("eye", "hand")]
    cell = Cell(
        reference=next(iter(poses)),
        robots={name: Robot(name) for name in poses},
        cameras={"camera": CellCamera("camera", carriers[0])},
        targets={"target": CellTarget("target", carriers[1])},
    )
    seen = record.camera_from_target
    assert seen is not None
    samples = [
        Sample(
            k,
            robots={name: RobotState(pose[k]) for name, pose in poses.items()},
            observations=(PoseObservation("camera", "target", seen[k]),),
        )
        for k in range(len(seen))
    ]
    recording = Recording(tuple(samples))
    return ArrayCalibration(calibrate(cell, recording, settings), cell, recording, names, words)
