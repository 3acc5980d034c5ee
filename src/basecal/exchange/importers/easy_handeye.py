"""Samples and calibrations of easy_handeye."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from basecal.exchange.hand_eye import easy_handeye
from basecal.exchange.importing.hand_eye import Carriers, hand_eye_of_file
from basecal.exchange.importing.imported import Imported


def read_easy_handeye(
    cell: str | Path,
    file: str | Path,
    /,
    *,
    camera_on: str | None = None,
    target_on: str | None = None,
    robot: str | None = None,
    camera: str | None = None,
    target: str | None = None,
) -> Imported:
    """Samples or a calibration of easy_handeye (ROS 1) or easy_handeye2 (ROS 2).

    Reads `.samples`, `.calib`, the calibration's `.yaml`, and what the services
    take_sample and get_sample_list answered, as YAML. Metres. Eye-on-base
    robot poses, which it writes inverted, are turned back. A calibration
    becomes a guess of where the camera is. Makes the cell where there is none.
    A second arm that stands still may carry the camera or the target; its pose is
    one row of `basecal import poses --still`.

    For example:

        basecal import easy-handeye mycell ur5_eob.samples
        basecal import easy-handeye mycell run.samples --camera-on world
        basecal import easy-handeye mycell left.samples --camera-on left \\
            --target-on right

    Args:
        cell: Folder of the cell.
        file: What easy_handeye wrote.
        camera_on: What carries the camera, where file and cell do not say: robot (eye in hand), world (on base), or the
            name of a robot.
        target_on: What carries the target, if it is another robot, which is still.
        robot: Name of the robot in the cell.
        camera: Name of the camera in the cell.
        target: Name of the target in the cell.

    Raises:
        InputError: if it cannot be read, or does not fit the cell.
    """
    read = partial(easy_handeye.read_easy_handeye, file)
    return hand_eye_of_file(cell, read, Carriers(camera_on, target_on), robot, camera, target)
