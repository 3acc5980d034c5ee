"""Import of Kalibr's camera chains and target descriptions.

`pinhole` with `radtan` has terms k1 k2 p1 p2 in OpenCV's order, with `equidistant` the fisheye's four. `T_cn_cnm1` is
camera n from camera n - 1, in metres. Data of the IMU (`T_cam_imu`, `timeshift_cam_imu`) are ignored. Corners are
detected with OpenCV, so the centre of the top-left pixel is (0, 0). A checkerboard is sized by its inner corners. An
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
    make_camera,
    mount_by_chain,
    previous_camera,
)

_PROJECTION = "pinhole"  # the supported projection of Kalibr
_MODELS = {"radtan": ("pinhole", 4), "equidistant": ("fisheye", 4), "none": ("pinhole", 0)}
_FAMILY = "tag36h11"  # family of Kalibr's own boards
_SIDE_TOLERANCE = 1e-6  # largest relative difference of a square's sides: below any printer's accuracy


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
    """Import a camera's lens from a camchain of Kalibr, or a target from its YAML.

    Reads pinhole-radtan and pinhole-equi; aprilgrid, checkerboard and
    circlegrid. If the cell has the pose of the previous camera in the chain,
    T_cn_cnm1 gives the initial guess of this camera's pose. Data of the IMU are
    ignored. A lens replaces the intrinsics in cell.yaml.

    For example:

        basecal import kalibr mycell camchain.yaml --camera wrist
        basecal import kalibr mycell aprilgrid.yaml --target board --on hand

    Args:
        cell: Folder of the cell.
        file: The camchain, or the description of a target.
        camera: Name of the camera; may be omitted if the cell has one.
        target: Name of the target; may be omitted if the cell has one.
        on: Carrier of a new camera or target: a robot, or world.
        status: Whether the intrinsics are fixed, or free with these values as the initial guess.
        camera_of_file: Camera of the file (cam0, cam1, ...), if it has several.

    Raises:
        InputError: if the file cannot be read, is inconsistent with the cell, or the images have another size.
    """
    known = known_cell(cell)
    if is_target(file):
        return imported_target(known, read_target(file), str(file), target, on)
    lenses = {str(lens.name): lens for lens in read_camchain(file)}
    chosen = next(iter(lenses)) if camera_of_file is None and len(lenses) == 1 else camera_of_file
    chosen = camera if chosen is None and camera in lenses else chosen
    if chosen is None or chosen not in lenses:
        raise InputError(f"{file} has {list_names(list(lenses))}: choose one with --camera-of-file")
    chain = tuple(lenses.values())
    mount, previous = mount_by_chain(known, chain, chosen), previous_camera(known, chain, chosen)
    carrier = None if previous is None else previous.on
    return lens_of_file(cell, lenses[chosen], file, camera, on, status, mount, carrier)


def read_camchain(path: str | Path) -> tuple[StatedLens, ...]:
    """Read the lenses of a `camchain.yaml` in their order, with the pose of each relative to the previous camera.

    Raises:
        DatasetError: if the file is not a camchain, or a lens model is not supported.
    """
    root = read_fields(path)
    names = [name for name in root.names() if name.startswith("cam")]
    if not names:
        content = list_names(root.names())
        raise root.error(f"holds {content}: a camchain of Kalibr has cam0, cam1, ...; a target of it has target_type")
    return tuple(_lens(root.find(name), name) for name in names)


def _lens(camera: Field, name: str) -> StatedLens:
    projection = camera.find("camera_model")
    if projection.text() != _PROJECTION:
        raise projection.error(f"{projection.data!r} is not supported: calibrate with pinhole-radtan or pinhole-equi")
    distortion = camera.find("distortion_model")
    if distortion.text() not in _MODELS:
        raise distortion.error(f"{distortion.data!r} is not supported; there are: {list_names(list(_MODELS))}")
    model, count = _MODELS[distortion.data]
    terms = camera.find("distortion_coeffs").numbers(count) if count else []
    width, height = camera.find("resolution").size()
    intrinsics = camera.find("intrinsics")
    lens = make_camera(intrinsics, model, [*intrinsics.numbers(4), *terms], (width, height))
    camera_from_previous = camera.first("T_cn_cnm1")
    return StatedLens(
        lens,
        f"{name} of Kalibr, pinhole-{distortion.data}, {width} x {height} px, the centre of the top-left pixel is "
        "(0, 0)",
        name,
        None if camera_from_previous is None else camera_from_previous.pose(),
    )


def is_target(path: str | Path) -> bool:
    """Whether a file of Kalibr describes a target.

    Raises:
        DatasetError: if the file cannot be read.
    """
    return read_fields(path).first("target_type") is not None


def read_target(path: str | Path) -> dict[str, Any]:
    """Read the kind and sizes of the target in a `target.yaml`, as an entry of `cell.yaml`.

    Raises:
        DatasetError: if the file is invalid, or the target is not supported.
    """
    root = read_fields(path)
    kind = root.find("target_type")
    if kind.text() not in _TARGETS:
        raise kind.error(f"{kind.data!r} is not a target of Kalibr; there are: {list_names(list(_TARGETS))}")
    return _TARGETS[kind.data](root)


def _aprilgrid(root: Field) -> dict[str, Any]:
    if (first := root.first("codeOffset")) is not None and first.integer(0):
        raise first.error("tags of a grid must start with number 0: print such a grid")
    return {
        "kind": "aprilgrid",
        "tags": [root.find("tagCols").integer(), root.find("tagRows").integer()],
        "tag_m": root.find("tagSize").number(),
        "spacing": root.find("tagSpacing").number(),
        "family": _FAMILY,
    }


def _checkerboard(root: Field) -> dict[str, Any]:
    across, down = root.find("colSpacingMeters"), root.find("rowSpacingMeters")
    if abs(across.number() - down.number()) > _SIDE_TOLERANCE * abs(across.number()):
        raise down.error(f"is {down.data}, colSpacingMeters {across.data}: fields of a board must be square")
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
