"""A lens from a camchain of Kalibr, or a target from its YAML."""

from __future__ import annotations

from pathlib import Path

from basecal.errors import InputError, list_names
from basecal.exchange.importing.cell_content import known_cell
from basecal.exchange.importing.imported import Imported
from basecal.exchange.importing.lens import LensStatus, imported_target, lens_of_file, mount_by_chain
from basecal.exchange.lens_files.kalibr import is_target, read_camchain, read_target


def read_kalibr(
    cell: str | Path,
    file: str | Path,
    /,
    *,
    camera: str | None = None,
    target: str | None = None,
    on: str | None = None,
    status: LensStatus = "fixed",
    camera_of_file: str | None = None,
) -> Imported:
    """The lens of a camera from a camchain of Kalibr, or a target from its YAML.

    Reads pinhole-radtan and pinhole-equi; aprilgrid, checkerboard and
    circlegrid. Where the cell knows where the camera before it in the chain
    is, T_cn_cnm1 gives a guess of where this one is. The IMU is not read. A
    lens stands in for the intrinsics in cell.yaml.

    For example:

        basecal import kalibr mycell camchain.yaml --camera wrist
        basecal import kalibr mycell aprilgrid.yaml --target board --on hand

    Args:
        cell: Folder of the cell.
        file: The camchain, or the description of a target.
        camera: Name of the camera; may be left out where the cell has one.
        target: Name of the target; likewise.
        on: The robot that carries it, or world, where the cell does not have it yet.
        status: Whether the intrinsics are fixed, or free with these for a start.
        camera_of_file: Which camera of the file (cam0, cam1, ...), where it has several.

    Raises:
        InputError: if it cannot be read, does not fit the cell, or the images have another size.
    """
    known = known_cell(cell)
    if is_target(file):
        return imported_target(known, read_target(file), str(file), target, on)
    lenses = {str(lens.name): lens for lens in read_camchain(file)}
    chosen = next(iter(lenses)) if camera_of_file is None and len(lenses) == 1 else camera_of_file
    chosen = camera if chosen is None and camera in lenses else chosen
    if chosen is None or chosen not in lenses:
        raise InputError(f"{file} has {list_names(list(lenses))}: say which one by --camera-of-file")
    mount = mount_by_chain(known, tuple(lenses.values()), chosen)
    return lens_of_file(cell, lenses[chosen], file, camera, on, status, mount)
