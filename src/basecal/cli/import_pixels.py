"""`basecal import pixels`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter, validators

from basecal.cli.streams import Inverted, Streams, Unit, import_streams


def import_pixels(
    cell: Path,
    pixels: str,
    /,
    *,
    length_unit: Unit,
    eye_base_from_flange: str | None = None,
    hand_base_from_flange: str | None = None,
    camera: str | None = None,
    target: str | None = None,
    sigma_px: Annotated[float | None, Parameter(validator=validators.Number(gt=0))] = None,
    invert: Annotated[tuple[Inverted, ...], Parameter(consume_multiple=True)] = (),
) -> int:
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
    """
    files = Streams(eye_base_from_flange, hand_base_from_flange, None, length_unit, invert, pixels, sigma_px)
    return import_streams(cell, files, camera, target)
