"""Data sets of industrial_calibration of ROS-Industrial, and of robot_cal_tools."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from basecal.exchange.hand_eye import industrial
from basecal.exchange.importing.hand_eye import Carriers, hand_eye_of_file
from basecal.exchange.importing.imported import Imported


def read_data_set(
    cell: str | Path,
    file: str | Path,
    /,
    *,
    camera_on: str | None = None,
    target_on: str | None = None,
    robot: str | None = None,
    camera: str | None = None,
    target: str | None = None,
    intrinsics: Path | None = None,
    target_file: Path | None = None,
    link: bool = False,
) -> Imported:
    """Images and robot poses of a data set of industrial_calibration or robot_cal_tools.

    Reads the list of images and poses (metres, quaternions). Reads the camera's
    intrinsics, which become a start, and the ChArUco board or grid of circles.
    They may be in the list or in files of their own. Guesses of mounts are
    taken over.

    For example:

        basecal import industrial-calibration mycell cal_data.yaml
        basecal import robot-cal-tools mycell cal_data.yaml --camera-on robot \\
            --intrinsics camera_intr.yaml --target-file target.yaml

    Args:
        cell: Folder of the cell.
        file: The list of images and poses.
        camera_on: What carries the camera, where neither file nor cell says: robot, or world.
        target_on: What carries the target, if it is another robot, which is still.
        robot: Name of the robot in the cell.
        camera: Name of the camera in the cell.
        target: Name of the target in the cell.
        intrinsics: File of the camera's intrinsics, where they are not in the list.
        target_file: File of the target, where it is not in the list.
        link: Make hard links to the images instead of copies.

    Raises:
        InputError: if it cannot be read, or does not fit the cell.
    """
    read = partial(industrial.read_data_set, file, lens=intrinsics, target=target_file)
    return hand_eye_of_file(cell, read, Carriers(camera_on, target_on), robot, camera, target, link)
