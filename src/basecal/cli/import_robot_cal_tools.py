"""`basecal import robot-cal-tools`."""

from __future__ import annotations

from pathlib import Path

from basecal.cli.hand_eye_import import CameraOn, import_hand_eye


def import_robot_cal_tools(
    cell: Path,
    file: Path,
    /,
    *,
    camera_on: CameraOn | None = None,
    robot: str | None = None,
    camera: str | None = None,
    target: str | None = None,
    intrinsics: Path | None = None,
    target_file: Path | None = None,
    link: bool = False,
) -> int:
    """Pictures and robot poses of a data set of robot_cal_tools.

    Reads the list of pictures and poses (metres, quaternions), and, where they
    are written in it or in files of their own, the camera's intrinsics, which
    become a start, and the ChArUco board or grid of circles. Guesses of mounts
    are taken over.

    For example:

        basecal import robot-cal-tools mycell cal_data.yaml --camera-on robot \\
            --intrinsics camera_intr.yaml --target-file target.yaml

    Args:
        cell: Folder of the cell.
        file: The list of pictures and poses.
        camera_on: What carries the camera, where neither file nor cell says: robot, or world.
        robot: Name of the robot in the cell.
        camera: Name of the camera in the cell.
        target: Name of the target in the cell.
        intrinsics: File of the camera's intrinsics, where they are not in the list.
        target_file: File of the target, where it is not in the list.
        link: Make hard links to the pictures instead of copies.
    """
    from basecal.exchange.hand_eye.industrial import read_data_set

    return import_hand_eye(
        cell,
        lambda on_robot: read_data_set(file, on_robot, intrinsics, target_file),
        camera_on=camera_on,
        robot=robot,
        camera=camera,
        target=target,
        link=link,
    )
