"""Import of lenses and targets that a file states into a cell."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from basecal.cell import CellCamera
from basecal.cell.format.plain import numbers, pose_dict
from basecal.errors import InputError, count_text
from basecal.exchange.fields import Field
from basecal.exchange.importing.imported import (
    Imported,
    KnownCell,
    NoCell,
    carried_entry,
    check_robot,
    choose_carrier,
    choose_name,
    known_cell,
    recorded_samples,
)
from basecal.geometry import SE3, Camera

LensStatus = Literal["fixed", "free"]
OPENCV_TERMS = (0, 4, 5, 8, 12)
"""Supported numbers of pinhole distortion terms, in OpenCV's order; OpenCV has two more for a tilted sensor."""

_TILTED_TERMS = 14


def lens_of_file(
    folder: str | Path,
    lens: StatedLens,
    file: str | Path,
    camera: str | None,
    carrier: str | None,
    status: LensStatus,
    mount: SE3 | None = None,
    mount_carrier: str | None = None,
) -> Imported:
    """Import a lens; its model, size and intrinsics replace those of the camera in the cell.

    Args:
        folder: Folder of the cell, or of a new cell.
        lens: The lens.
        file: File of the lens, as named by the user.
        camera: Name of the camera; the cell's only camera if None.
        carrier: The robot that carries the camera, or `world`; from the cell if None.
        status: `fixed`, or `free` for an initial guess of estimated intrinsics.
        mount: Initial guess of the camera's pose in its carrier; None if unknown.
        mount_carrier: Carrier of the guess, by default also of a new camera; a camera on another one gets no guess.

    Raises:
        InputError: if the camera or its carrier is ambiguous, or its images have another size.
    """
    cell, source = known_cell(folder), str(file)
    name = choose_name("camera", camera, cell.cameras, "camera")
    known = cell.cameras.get(name)
    entry: dict[str, Any] = camera_entry(lens.camera, status)
    data: dict[str, Any] = {"cameras": {name: entry}}
    if known is None:
        stated = carrier or mount_carrier or (None if cell.robots else "eye")
        camera_on = choose_carrier(cell, "camera", name, stated, may_be_world=False)
        check_robot(cell, camera_on)
        data = carried_entry("cameras", name, camera_on, **entry)
    else:
        camera_on = known.on
        _check_size(Path(folder), cell, name, lens.camera.size_px, source)
    is_open = known is None or (known.mount.status == "free" and known.mount.mean is None)
    if mount is not None and is_open and mount_carrier in (None, camera_on):
        data["cameras"][name]["mount"] = {"status": "free", "guess": pose_dict(mount)}
    replaced = frozenset({("cameras", name, "model"), ("cameras", name, "intrinsics")})
    what = f"{lens.what}; written as {status} intrinsics of camera {name!r}"
    return Imported(source, what, cell=data, replaced=replaced, advice="check that the file is of this camera")


def _check_size(folder: Path, cell: KnownCell, camera: str, size_px: tuple[int, int] | None, source: str) -> None:
    """Raise an InputError if the cell, or the first image of the camera, has another size."""
    from basecal.exchange.images import image_size  # reads image headers, not needed for exports

    samples = recorded_samples(folder, cell)
    image = next((sample.images[camera] for sample in samples if camera in sample.images), None)
    sizes = {f"camera {camera!r} in cell.yaml": cell.cameras[camera].size_px}
    sizes |= {} if image is None else {image: image_size(folder / image)}
    for subject, size in sizes.items():
        if size is not None and size_px is not None and tuple(size) != tuple(size_px):
            found = f"{source} is of {size_px[0]} x {size_px[1]} px, {subject} has {size[0]} x {size[1]}"
            raise InputError(f"{found}: import the calibration of the images' size, or correct size_px")


def mount_by_chain(cell: KnownCell, lenses: Sequence[StatedLens], name: str) -> SE3 | None:
    """Pose of a camera of a chain in the carrier of the previous camera; None if that camera's pose is unknown.

    Args:
        cell: The cell, whose cameras have the names of the chain's.
        lenses: Lenses of the chain.
        name: Name of the camera in the chain.
    """
    previous = previous_camera(cell, lenses, name)
    camera_from_previous = next(lens.camera_from_previous for lens in lenses if lens.name == name)
    if previous is None or previous.mount.mean is None or camera_from_previous is None:
        return None
    return previous.mount.mean @ camera_from_previous.inverse()


def previous_camera(cell: KnownCell, lenses: Sequence[StatedLens], name: str) -> CellCamera | None:
    """Camera of the cell that is before a camera of a chain; None if there is none."""
    index = [lens.name for lens in lenses].index(name)
    return None if index == 0 else cell.cameras.get(str(lenses[index - 1].name))


def imported_target(
    cell: KnownCell, target: Mapping[str, Any], source: str, name: str | None, carrier: str | None
) -> Imported:
    """Import a target whose kind and sizes are stated in a file.

    Args:
        cell: The cell.
        target: Fields of `cell.yaml` for the kind and sizes.
        source: The file, as named by the user.
        name: Name of the target; the cell's only target if None.
        carrier: The robot that carries the target, or `world`; from the cell if None.

    Raises:
        InputError: if there is no cell, or the target or its carrier is ambiguous.
    """
    if isinstance(cell, NoCell):
        raise InputError(
            f"there is no cell.yaml to put the target of {source} into: basecal new, or import poses first"
        )
    name = choose_name("target", name, cell.targets, "target")
    data: dict[str, Any] = {"targets": {name: dict(target)}}
    if name not in cell.targets:
        target_on = choose_carrier(cell, "target", name, carrier)
        check_robot(cell, target_on)
        data = carried_entry("targets", name, target_on, **target)
    sizes = ", ".join(f"{key} {value}" for key, value in target.items() if key != "kind")
    what = f"a target, {target['kind']}: {sizes}"
    return Imported(source, what, cell=data, advice="check its sizes")


@dataclass(frozen=True, eq=False)
class StatedLens:
    """A lens in a file.

    Attributes:
        camera: The lens; the centre of the top-left pixel is (0, 0), regardless of the file's pixel origin.
        what: Description of the lens: its model, and the file's pixel origin.
        name: Name of the camera in the file; None if not stated.
        camera_from_previous: Pose of the previous camera of the file in this camera; None if not stated.
    """

    camera: Camera
    what: str
    name: str | None = None
    camera_from_previous: SE3 | None = None


def make_camera(field: Field, model: str, parameters: Sequence[float], size_px: tuple[int, int] | None) -> Camera:
    """Create a camera from fx, fy, cx, cy [px] and distortion terms; errors refer to a field of a file.

    Raises:
        DatasetError: if the parameters are not a valid lens.
    """
    try:
        return Camera(model, np.array(parameters, dtype=np.float64), size_px)
    except InputError as error:
        raise field.error(str(error)) from None


def opencv_terms(field: Field, terms: Sequence[float]) -> list[float]:
    """Check distortion terms in OpenCV's order, and remove the zero terms of a tilted sensor.

    Raises:
        DatasetError: if the number of terms is not supported, or the sensor is tilted.
    """
    if len(terms) == _TILTED_TERMS:
        if any(terms[-2:]):
            raise field.error(
                "the last two of 14 terms tilt the sensor, which is not supported: calibrate without them"
            )
        terms = terms[:-2]
    if len(terms) not in OPENCV_TERMS:
        known = " or ".join(map(str, (*OPENCV_TERMS, _TILTED_TERMS)))
        raise field.error(f"has {count_text(len(terms), 'distortion term')}, expected {known}, in OpenCV's order")
    return list(terms)


def matrix_parameters(field: Field, matrix: Sequence[float]) -> list[float]:
    """Extract fx, fy, cx, cy from the nine numbers of a camera matrix, row by row.

    Raises:
        DatasetError: if the numbers are not a camera matrix, or have a skew.
    """
    fx, skew, cx, lower, fy, cy, *last = matrix
    if not any(matrix[:6]):
        raise field.error("is all zero: the camera is not calibrated; calibrate it, or leave its intrinsics free")
    if lower or list(last) != [0.0, 0.0, 1.0]:
        raise field.error("is not a camera matrix, row by row: fx 0 cx, 0 fy cy, 0 0 1; is it transposed?")
    if skew:
        raise field.error(f"has a skew of {skew:g} px, which is not supported: calibrate without it")
    return [fx, fy, cx, cy]


def camera_entry(camera: Camera, status: str) -> dict[str, Any]:
    """Entry of `cell.yaml` for a lens: its model, size and intrinsics."""
    fx, fy, cx, cy, *terms = numbers(camera.parameters)
    size = {} if camera.size_px is None else {"size_px": list(camera.size_px)}
    lens = {"status": status, "fx": fx, "fy": fy, "cx": cx, "cy": cy, "distortion": terms}
    return {"model": camera.model, **size, "intrinsics": lens}
