"""Arrays under OpenCV's names, of an archive of NumPy or a JSON file."""

from __future__ import annotations

from pathlib import Path

from basecal.exchange.hand_eye.arrays import read_record_of_arrays
from basecal.exchange.hand_eye.record import HandEyeRecord
from basecal.exchange.importing.hand_eye import Carriers, hand_eye_of_file
from basecal.exchange.importing.imported import Imported
from basecal.exchange.poses import LengthUnit, unit_length_m


def read_array_file(
    cell: str | Path,
    file: str | Path,
    /,
    *,
    camera_on: str | None = None,
    target_on: str | None = None,
    robot: str | None = None,
    hand: str | None = None,
    camera: str | None = None,
    target: str | None = None,
    unit: LengthUnit = "m",
) -> Imported:
    """Arrays under OpenCV's names, of a NumPy archive (.npz), JSON or FileStorage.

    Reads R_gripper2base, t_gripper2base, R_target2cam and t_target2cam of
    calibrateHandEye, or R_world2cam, t_world2cam, R_base2gripper and
    t_base2gripper of calibrateRobotWorldHandEye. Two arms have
    R_eye_gripper2base, t_eye_gripper2base, R_hand_gripper2base,
    t_hand_gripper2base, R_target2cam and t_target2cam. Rotations are matrices
    or rotation vectors [rad]; 4x4 matrices T_gripper2base and the like are both.
    Makes the cell where there is none.

    For example:

        basecal import arrays mycell poses.npz
        basecal import arrays mycell poses.json --camera-on world
        basecal import arrays mycell two_arms.npz --robot left --hand right

    Args:
        cell: Folder of the cell.
        file: The archive, the JSON file, or the FileStorage (.yml, .xml).
        camera_on: What carries the camera of one arm: robot, unless the cell says otherwise, or world.
        target_on: What carries the target, if it is another robot, which is still.
        robot: Name of the robot in the cell; of two, of the one that carries the camera.
        hand: Name of the robot that carries the target, of two.
        camera: Name of the camera in the cell.
        target: Name of the target in the cell.
        unit: Of the translations.

    Raises:
        InputError: if it cannot be read, or does not fit the cell.
    """

    def read(camera_on_robot: bool | None) -> HandEyeRecord:
        """The record, given what cell or user say."""
        return read_record_of_arrays(file, camera_on_robot, unit_length_m(unit))

    advice = f"all lengths are read in {unit}: check --unit, or convert arrays of another unit; then check --camera-on"
    return hand_eye_of_file(cell, read, Carriers(camera_on, target_on), robot, camera, target, hand=hand, advice=advice)
