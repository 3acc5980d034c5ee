"""`basecal import camera-info`."""

from __future__ import annotations

from pathlib import Path

from basecal.cli.lens_import import LensStatus, import_lens


def import_camera_info(
    cell: Path,
    file: Path,
    /,
    *,
    camera: str | None = None,
    on: str | None = None,
    status: LensStatus = "fixed",
) -> int:
    """The lens of a camera from a camera_info file of ROS.

    Reads the YAML that ROS's camera calibration writes, and what `ros2 topic
    echo --once` printed of a camera_info: plumb_bob, rational_polynomial and
    equidistant. It stands in for the intrinsics in cell.yaml; the size must be
    that of the recorded pictures.

    For example:

        basecal import camera-info mycell ost.yaml --camera wrist

    Args:
        cell: Folder of the cell.
        file: The camera_info.
        camera: Name of the camera; may be left out where the cell has one.
        on: The robot that carries it, or world, where the cell does not have it yet.
        status: Whether the intrinsics are fixed, or free with these for a start.
    """
    from basecal.exchange.lens_files.camera_info import read_camera_info

    return import_lens(cell, read_camera_info(file), str(file), camera=camera, on=on, status=status)
