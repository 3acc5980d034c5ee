"""A lens from a file that a script wrote with OpenCV."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Literal

from basecal.errors import InputError
from basecal.exchange.importing.imported import Imported
from basecal.exchange.importing.lens import LensStatus, lens_of_file
from basecal.exchange.lens_files import opencv
from basecal.geometry import Camera


def read_opencv(
    cell: str | Path,
    file: str | Path,
    /,
    *,
    camera: str | None = None,
    on: str | None = None,
    status: LensStatus = "fixed",
    model: str | None = None,
    which: Literal[1, 2] | None = None,
    size_px: tuple[int, int] | None = None,
) -> Imported:
    """The lens of a camera from a file that a script wrote with OpenCV.

    Reads FileStorage (.yml, .xml, .json) and NumPy archives (.npz). The camera
    matrix is called camera_matrix, cameraMatrix, mtx or K, the distortion
    coefficients distortion_coefficients, distCoeffs, dist or D. The lens replaces
    the intrinsics in cell.yaml; the size must be that of the recorded images.

    For example:

        basecal import opencv mycell calibration.yml --camera wrist
        basecal import opencv mycell lens.npz --camera wrist --size-px 1280 720

    Args:
        cell: Folder of the cell.
        file: What OpenCV or NumPy wrote.
        camera: Name of the camera; may be left out where the cell has one.
        on: The robot that carries it, or world, where the cell does not have it yet.
        status: Whether the intrinsics are fixed, or free with these for a start.
        model: Lens model, where the file does not say that it is a fisheye's.
        which: Which of two cameras (M1, D1 or M2, D2).
        size_px: Width and height of its images, where the file does not say.

    Raises:
        InputError: if it cannot be read, does not fit the cell, or the images have another size.
    """
    lens = opencv.read_opencv(file, model, which)
    stated = lens.camera.size_px
    if size_px is not None and stated not in (None, size_px):
        raise InputError(f"{file} is of {stated[0]} x {stated[1]} px: leave --size-px away, or correct the file")
    if size_px is not None:
        lens = replace(lens, camera=Camera(lens.camera.model, lens.camera.parameters, size_px))
    return lens_of_file(cell, lens, file, camera, on, status)
