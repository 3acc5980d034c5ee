"""Points that another program found in images, with files of poses."""

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
    """Make a recording of a file of detected points and files of robot poses.

    Points are one a row: sample, id, u, v (.csv with this header, or .npz with
    these arrays). Sample i is the i-th pose of each robot's file, counted from
    0; files of poses are as in `basecal import poses --help`. The cell must be
    there already, since it says what target and which lens: `basecal new`.

    For example:

        basecal new mycell --robots 2 --target charuco
        basecal import pixels mycell corners.csv --length-unit m \\
            --eye-base-from-flange A.txt --hand-base-from-flange C.txt

    Args:
        cell: Folder of the cell.
        pixels: File of the points.
        length_unit: What all lengths in the pose files are in.
        eye_base_from_flange: Poses of the flange that carries the camera, in its robot's base.
        hand_base_from_flange: Poses of the flange that carries the target, in its robot's base.
        camera: Name of the camera, where the cell has several.
        target: Name of the target, where the cell has several.
        sigma_px: Noise of the points, per coordinate; estimated where not stated.
        invert: Pose files that hold the inverse, by the name of their option.

    Raises:
        UsageError: if the sigma is not above zero.
        InputError: if something is recorded, or files and cell do not fit.
    """
    if sigma_px is not None and not sigma_px > 0:
        raise UsageError(f"--sigma-px {sigma_px:g}: expected more than 0")
    files = Streams(eye_base_from_flange, hand_base_from_flange, None, length_unit, invert, str(pixels), sigma_px)
    return read_streams(cell, files, camera, target)
