"""Import of points detected in images by another program, with files of poses."""

from __future__ import annotations

from pathlib import Path

from basecal.errors import UsageError
from basecal.exchange.importing.imported import Imported
from basecal.exchange.poses import LengthUnit
from basecal.exchange.streams import Inverted, Streams, read_streams


def read_pixels(
    cell: str | Path,
    pixels: str | Path,
    /,
    *,
    length_unit: LengthUnit,
    eye_base_from_flange: str | None = None,
    hand_base_from_flange: str | None = None,
    camera: str | None = None,
    target: str | None = None,
    sigma_px: float | None = None,
    invert: tuple[Inverted, ...] = (),
) -> Imported:
    """Import a file of detected points and files of robot poses as a recording.

    The file has one point per row: sample, id, u, v (.csv with this header, or
    .npz with these arrays). Sample i is the i-th pose of each robot's file,
    counted from 0; `basecal import poses --help` describes files of poses. The
    cell must exist, because it describes the target and the lens: `basecal new`.

    For example:

        basecal new mycell --robots 2 --target charuco
        basecal import pixels mycell corners.csv --length-unit m \\
            --eye-base-from-flange A.txt --hand-base-from-flange C.txt

    Args:
        cell: Folder of the cell.
        pixels: File of the points.
        length_unit: Unit of all lengths in the pose files.
        eye_base_from_flange: Poses of the flange that carries the camera, in its robot's base.
        hand_base_from_flange: Poses of the flange that carries the target, in its robot's base.
        camera: Name of the camera, if the cell has several.
        target: Name of the target, if the cell has several.
        sigma_px: Sigma of the points per coordinate [px]; estimated if not given.
        invert: Pose files that hold inverse poses, by the name of their option.

    Raises:
        UsageError: if the sigma is not above zero.
        InputError: if a file cannot be read, or files and cell are inconsistent.
    """
    if sigma_px is not None and not sigma_px > 0:
        raise UsageError(f"--sigma-px {sigma_px:g}: expected more than 0")
    files = Streams(eye_base_from_flange, hand_base_from_flange, None, length_unit, invert, str(pixels), sigma_px)
    return read_streams(cell, files, camera, target)
