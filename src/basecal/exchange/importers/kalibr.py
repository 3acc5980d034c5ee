"""Kalibr's chain of cameras, and its description of a target.

`pinhole` with `radtan` has terms k1 k2 p1 p2 in OpenCV's order, with `equidistant` the fisheye's four. `T_cn_cnm1` is
camera n from camera n - 1, in metres. A cell holds nothing of the IMU (`T_cam_imu`, `timeshift_cam_imu`). Corners are
found by OpenCV, so the centre of the top-left pixel is (0, 0). A checkerboard is counted by inner corners. An
asymmetric grid of circles has circle c of row r at ((2 c + r mod 2) spacing, r spacing), as in OpenCV.
Source: Kalibr's wiki, "yaml formats", "supported models" and "calibration targets"; GridCalibrationTargetCirclegrid.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from basecal.errors import InputError, list_names
from basecal.exchange.fields import Field, read_fields
from basecal.exchange.importing.imported import Imported, known_cell
from basecal.exchange.importing.lens import (
    LensStatus,
    StatedLens,
    imported_target,
    lens_of_file,
    made_camera,
    mount_by_chain,
)

_PROJECTION = "pinhole"  # the one of Kalibr's that lenses here have
_MODELS = {"radtan": ("pinhole", 4), "equidistant": ("fisheye", 4), "none": ("pinhole", 0)}
_FAMILY = "tag36h11"  # the one that Kalibr's own boards are printed in
_EQUAL_SIDES = 1e-6  # of both sides of a square: below what any printer keeps


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


def read_camchain(path: str | Path) -> tuple[StatedLens, ...]:
    """The lenses of a `camchain.yaml`, in their order, where each stands from the one before.

    Raises:
        DatasetError: if it is none, or a lens has no equal here.
    """
    root = read_fields(path)
    names = [name for name in root.names() if name.startswith("cam")]
    if not names:
        held = list_names(root.names())
        raise root.error(f"holds {held}: a camchain of Kalibr has cam0, cam1, ...; a target of it has target_type")
    return tuple(_lens(root.find(name), name) for name in names)


def _lens(camera: Field, name: str) -> StatedLens:
    projection = camera.find("camera_model")
    if projection.text() != _PROJECTION:
        raise projection.error(f"{projection.data!r} has no equal here: calibrate with pinhole-radtan or pinhole-equi")
    distortion = camera.find("distortion_model")
    if distortion.text() not in _MODELS:
        raise distortion.error(f"{distortion.data!r} has no equal here; there are: {list_names(list(_MODELS))}")
    model, count = _MODELS[distortion.data]
    terms = camera.find("distortion_coeffs").numbers(count) if count else []
    width, height = camera.find("resolution").size()
    intrinsics = camera.find("intrinsics")
    made = made_camera(intrinsics, model, [*intrinsics.numbers(4), *terms], (width, height))
    before = camera.first("T_cn_cnm1")
    return StatedLens(
        made,
        f"{name} of Kalibr, pinhole-{distortion.data}, {width} x {height} px, the centre of the top-left pixel is "
        "(0, 0)",
        name,
        None if before is None else before.pose(),
    )


def is_target(path: str | Path) -> bool:
    """Whether a file of Kalibr's describes a target.

    Raises:
        DatasetError: if it cannot be read.
    """
    return read_fields(path).first("target_type") is not None


def read_target(path: str | Path) -> dict[str, Any]:
    """Entry of `cell.yaml` for the target in a `target.yaml`: its kind and sizes.

    Raises:
        DatasetError: if it is none, or has no equal here.
    """
    root = read_fields(path)
    kind = root.find("target_type")
    if kind.text() not in _TARGETS:
        raise kind.error(f"{kind.data!r} is no target of Kalibr's; there are: {list_names(list(_TARGETS))}")
    return _TARGETS[kind.data](root)


def _aprilgrid(root: Field) -> dict[str, Any]:
    if (first := root.first("codeOffset")) is not None and first.integer(0):
        raise first.error("the tags of a grid here begin with number 0: print one that does")
    return {
        "kind": "aprilgrid",
        "tags": [root.find("tagCols").integer(), root.find("tagRows").integer()],
        "tag_m": root.find("tagSize").number(),
        "spacing": root.find("tagSpacing").number(),
        "family": _FAMILY,
    }


def _checkerboard(root: Field) -> dict[str, Any]:
    across, down = root.find("colSpacingMeters"), root.find("rowSpacingMeters")
    if abs(across.number() - down.number()) > _EQUAL_SIDES * abs(across.number()):
        raise down.error(f"is {down.data}, colSpacingMeters {across.data}: the squares of a board here are square")
    corners = [root.find("targetCols").integer(2), root.find("targetRows").integer(2)]
    return {"kind": "chessboard", "corners": corners, "square_m": across.number()}


def _circlegrid(root: Field) -> dict[str, Any]:
    asymmetric = root.first("asymmetricGrid")
    return {
        "kind": "circles",
        "circles": [root.find("targetCols").integer(2), root.find("targetRows").integer(2)],
        "spacing_m": root.find("spacingMeters").number(),
        "asymmetric": asymmetric is not None and asymmetric.boolean(),
    }


_TARGETS: dict[str, Callable[[Field], dict[str, Any]]] = {
    "aprilgrid": _aprilgrid,
    "checkerboard": _checkerboard,
    "circlegrid": _circlegrid,
}
