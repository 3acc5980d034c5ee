"""A lens from a camera_info of ROS."""

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
    """The lens of a camera from a camera_info file of ROS.

    Reads the YAML that ROS's camera calibration writes, and what `ros2 topic
    echo --once` printed of a camera_info: plumb_bob, rational_polynomial and
    equidistant. It stands in for the intrinsics in cell.yaml; the size must be
    that of the recorded images.

    For example:

        basecal import camera-info mycell ost.yaml --camera wrist

    Args:
        cell: Folder of the cell.
        file: The camera_info.
        camera: Name of the camera; may be left out where the cell has one.
        on: The robot that carries it, or world, where the cell does not have it yet.
        status: Whether the intrinsics are fixed, or free with these for a start.

    Raises:
        InputError: if it cannot be read, does not fit the cell, or the images have another size.
    """
    return lens_of_file(cell, camera_info.read_camera_info(file), file, camera, on, status)
