"""`basecal import easy-handeye`."""

from __future__ import annotations

from pathlib import Path

from basecal.cli.hand_eye_import import CameraOn, import_hand_eye


def import_easy_handeye(
    cell: Path,
    file: Path,
    /,
    *,
    camera_on: CameraOn | None = None,
    robot: str | None = None,
    camera: str | None = None,
    target: str | None = None,
) -> int:
    """Samples or a calibration of easy_handeye (ROS 1) or easy_handeye2 (ROS 2).

    Reads `.samples`, `.calib`, the calibration's `.yaml`, and what the services
    take_sample and get_sample_list answered, as YAML. Metres. Eye-on-base
    robot poses, which it writes inverted, are turned back. A calibration
    becomes a guess of where the camera is. Makes the cell where there is none.

    For example:

        basecal import easy-handeye mycell ur5_eob.samples
        basecal import easy-handeye mycell run.samples --camera-on world

    Args:
        cell: Folder of the cell.
        file: What easy_handeye wrote.
        camera_on: What carries the camera, where file and cell do not say: robot (eye in hand) or world (on base).
        robot: Name of the robot in the cell.
        camera: Name of the camera in the cell.
        target: Name of the target in the cell.
    """
    from basecal.exchange.hand_eye.easy_handeye import read_easy_handeye

    return import_hand_eye(
        cell,
        lambda on_robot: read_easy_handeye(file, on_robot),
        camera_on=camera_on,
        robot=robot,
        camera=camera,
        target=target,
    )
