"""Import of a lens from a camera_info of ROS."""

from __future__ import annotations

from pathlib import Path

from basecal.exchange.importing.imported import Imported
from basecal.exchange.importing.lens import LensStatus, lens_of_file
from basecal.exchange.lens_files import camera_info


def read_camera_info(
    cell: str | Path,
    file: str | Path,
    /,
    *,
    camera: str | None = None,
    on: str | None = None,
    status: LensStatus = "fixed",
) -> Imported:
    """Import a camera's lens from a camera_info file of ROS.

    Reads the YAML of ROS's camera calibration, and the output of `ros2 topic
    echo --once` for a camera_info: plumb_bob, rational_polynomial and
    equidistant. The lens replaces the intrinsics in cell.yaml; the size must be
    that of the recorded images.

    For example:

        basecal import camera-info mycell ost.yaml --camera wrist

    Args:
        cell: Folder of the cell.
        file: The camera_info.
        camera: Name of the camera; may be omitted if the cell has one.
        on: Carrier of a new camera: a robot, or world.
        status: Whether the intrinsics are fixed, or free with these values as the initial guess.

    Raises:
        InputError: if the file cannot be read, is inconsistent with the cell, or the images have another size.
    """
    return lens_of_file(cell, camera_info.read_camera_info(file), file, camera, on, status)
