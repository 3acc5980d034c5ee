"""A lens from a cameramodel of mrcal."""

from __future__ import annotations

from pathlib import Path

from basecal.exchange.importing.imported import Imported
from basecal.exchange.importing.lens import LensStatus, lens_of_file
from basecal.exchange.lens_files.mrcal import read_cameramodel


def read_mrcal(
    cell: str | Path,
    file: str | Path,
    /,
    *,
    camera: str | None = None,
    on: str | None = None,
    status: LensStatus = "fixed",
) -> Imported:
    """The lens of a camera from a .cameramodel of mrcal.

    LENSMODEL_PINHOLE and LENSMODEL_OPENCV4, 5, 8 and 12 have an equal here;
    extrinsics are not read. It stands in for the intrinsics in cell.yaml; the
    size must be that of the recorded images.

    For example:

        basecal import mrcal mycell camera-0.cameramodel --camera wrist

    Args:
        cell: Folder of the cell.
        file: The cameramodel.
        camera: Name of the camera; may be left out where the cell has one.
        on: The robot that carries it, or world, where the cell does not have it yet.
        status: Whether the intrinsics are fixed, or free with these for a start.

    Raises:
        InputError: if it cannot be read, does not fit the cell, or the images have another size.
    """
    return lens_of_file(cell, read_cameramodel(file), file, camera, on, status)
