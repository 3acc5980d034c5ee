"""`basecal import poses`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from basecal.cli.streams import Inverted, Streams, Unit, import_streams


def import_poses(
    cell: Path,
    /,
    *,
    camera_from_target: str,
    length_unit: Unit,
    eye_base_from_flange: str | None = None,
    hand_base_from_flange: str | None = None,
    camera: str | None = None,
    target: str | None = None,
    invert: Annotated[tuple[Inverted, ...], Parameter(consume_multiple=True)] = (),
) -> int:
    """Make a recording of files of poses; pose i of each file belongs to the same
    instant.

    A file is 4x4 matrices one below the other (.txt: rows of four numbers), an
    array (n, 4, 4) (.npz, .npz:key, .npy), or a .csv whose header names x, y,
    z, qx, qy, qz, qw or m00 ... m23. Without a hand file the target stands on
    the world; without an eye file the camera does. Writes cell.yaml where there
    is none; a recording is never overwritten.

    For example:

        basecal import poses mycell --length-unit mm \\
            --eye-base-from-flange A.txt --hand-base-from-flange C.txt \\
            --camera-from-target B.txt
        basecal import poses mycell --length-unit m \\
            --eye-base-from-flange robot.csv \\
            --camera-from-target tag.npz:poses --invert camera-from-target

    Args:
        cell: Folder of the cell.
        camera_from_target: Poses of the target in the camera.
        length_unit: What all lengths in the files are in.
        eye_base_from_flange: Poses of the flange that carries the camera, in its robot's base.
        hand_base_from_flange: Poses of the flange that carries the target, in its robot's base.
        camera: Name of the camera, where the cell has several.
        target: Name of the target, where the cell has several.
        invert: Files that hold the inverse, by the name of their option.
    """
    files = Streams(eye_base_from_flange, hand_base_from_flange, camera_from_target, length_unit, invert)
    return import_streams(cell, files, camera, target)
