"""A lens from a reconstruction of COLMAP."""

from __future__ import annotations

from pathlib import Path

from basecal.errors import InputError, list_names
from basecal.exchange.importing.imported import Imported
from basecal.exchange.importing.lens import LensStatus, lens_of_file
from basecal.exchange.lens_files import colmap


def read_colmap(
    cell: str | Path,
    file: str | Path,
    /,
    *,
    camera: str | None = None,
    on: str | None = None,
    status: LensStatus = "fixed",
    camera_id: int | None = None,
) -> Imported:
    """The lens of a camera from a reconstruction of COLMAP.

    Reads cameras.txt or cameras.bin: SIMPLE_PINHOLE, PINHOLE, SIMPLE_RADIAL,
    RADIAL, OPENCV, FULL_OPENCV, OPENCV_FISHEYE, SIMPLE_RADIAL_FISHEYE and
    RADIAL_FISHEYE. Half a pixel is taken off the principal point: COLMAP
    counts from the corner of the picture. It stands in for the intrinsics in
    cell.yaml; the size must be that of the recorded pictures.

    For example:

        basecal import colmap mycell sparse/0 --camera wrist

    Args:
        cell: Folder of the cell.
        file: cameras.txt, cameras.bin, or the folder that holds one of them.
        camera: Name of the camera; may be left out where the cell has one.
        on: The robot that carries it, or world, where the cell does not have it yet.
        status: Whether the intrinsics are fixed, or free with these for a start.
        camera_id: Which one, where the file has several.

    Raises:
        InputError: if it cannot be read, does not fit the cell, or the pictures have another size.
    """
    lenses = colmap.read_colmap(file)
    chosen = next(iter(lenses)) if camera_id is None and len(lenses) == 1 else camera_id
    if chosen is None or chosen not in lenses:
        raise InputError(f"{file} has cameras {list_names(list(map(str, lenses)))}: say which one by --camera-id")
    return lens_of_file(cell, lenses[chosen], file, camera, on, status)
