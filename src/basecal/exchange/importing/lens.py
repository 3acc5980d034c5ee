"""A lens that a file states, as what an import brings into a cell."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from basecal.cell.format.plain import numbers, pose_dict
from basecal.errors import InputError
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
"""Distortion terms of the pinhole that lenses here have, in OpenCV's order; it knows two more, of a tilted sensor."""

_TILTED_TERMS = 14


def lens_of_file(
    folder: str | Path,
    lens: StatedLens,
    file: str | Path,
    camera: str | None,
    carrier: str | None,
    status: LensStatus,
    mount: SE3 | None = None,
) -> Imported:
    """The lens of a camera: its model, size and intrinsics stand in for what the cell says of them.

    Args:
        folder: The cell, or where one is to be made.
        lens: What was read.
        file: Its file, as the user named it.
        camera: Name of the camera; the only one of the cell where None.
        carrier: The robot that carries it, or `world`; what the cell says where None.
        status: `fixed`, or `free`: a start for intrinsics that are estimated.
        mount: Where it is roughly, in what carries it; None if not known.

    Raises:
        InputError: if it is not clear which camera it is or what carries it, or its images have another size.
    """
    cell, source = known_cell(folder), str(file)
    name = choose_name("camera", camera, cell.cameras, "camera")
    known = cell.cameras.get(name)
    entry: dict[str, Any] = camera_entry(lens.camera, status)
    data: dict[str, Any] = {"cameras": {name: entry}}
    if known is None:
        stated = carrier or (None if cell.robots else "eye")
        on = choose_carrier(cell, "camera", name, stated, may_be_world=False)
        check_robot(cell, on)
        data = carried_entry("cameras", name, on, **entry)
    else:
        _check_size(Path(folder), cell, name, lens.camera.size_px, source)
    if mount is not None and (known is None or (known.mount.status == "free" and known.mount.mean is None)):
        data["cameras"][name]["mount"] = {"status": "free", "guess": pose_dict(mount)}
    places = frozenset({("cameras", name, "model"), ("cameras", name, "intrinsics")})
    what = f"{lens.what}; written as {status} intrinsics of camera {name!r}"
    return Imported(source, what, cell=data, replaced=places, advice="check that the file is of this camera")


def _check_size(folder: Path, cell: KnownCell, camera: str, size_px: tuple[int, int] | None, source: str) -> None:
    """Raise an InputError if the cell, or the first image of the camera, has another size."""
    from basecal.exchange.images import image_size  # headers of images, which no export needs

    samples = recorded_samples(folder, cell)
    image = next((sample.images[camera] for sample in samples if camera in sample.images), None)
    sizes = {f"camera {camera!r} in cell.yaml": cell.cameras[camera].size_px}
    sizes |= {} if image is None else {image: image_size(folder / image)}
    for subject, size in sizes.items():
        if size is not None and size_px is not None and tuple(size) != tuple(size_px):
            found = f"{source} is of {size_px[0]} x {size_px[1]} px, {subject} has {size[0]} x {size[1]}"
            raise InputError(f"{found}: import the calibration of the images' size, or correct size_px")


def mount_by_chain(cell: KnownCell, lenses: Sequence[StatedLens], name: str) -> SE3 | None:
    """Where a camera of a chain is, in what carries it; None if the cell does not know the one before it.

    Args:
        cell: The cell there is, whose cameras have the names of the chain's.
        lenses: The chain.
        name: Of the camera in the chain.
    """
    names = [lens.name for lens in lenses]
    place = names.index(name)
    before = None if place == 0 else cell.cameras.get(str(names[place - 1]))
    camera_from_previous = lenses[place].camera_from_previous
    if before is None or before.mount.mean is None or camera_from_previous is None:
        return None
    return before.mount.mean @ camera_from_previous.inverse()


def imported_target(
    cell: KnownCell, target: Mapping[str, Any], source: str, name: str | None, carrier: str | None
) -> Imported:
    """A target of which a file states kind and sizes.

    Args:
        cell: The cell there is.
        target: What `cell.yaml` says of its kind and sizes.
        source: The file, as the user named it.
        name: Of the target; the only one of the cell where None.
        carrier: The robot that carries it, or `world`; what the cell says where None.

    Raises:
        InputError: if there is no cell, or it is not clear which target it is or what carries it.
    """
    if isinstance(cell, NoCell):
        raise InputError(
            f"there is no cell.yaml to put the target of {source} into: basecal new, or import poses first"
        )
    name = choose_name("target", name, cell.targets, "target")
    data: dict[str, Any] = {"targets": {name: dict(target)}}
    if name not in cell.targets:
        on = choose_carrier(cell, "target", name, carrier)
        check_robot(cell, on)
        data = carried_entry("targets", name, on, **target)
    sizes = ", ".join(f"{key} {value}" for key, value in target.items() if key != "kind")
    what = f"a target, {target['kind']}: {sizes}"
    return Imported(source, what, cell=data, advice="check its sizes")


@dataclass(frozen=True, eq=False)
class StatedLens:
    """A lens in a file.

    Attributes:
        camera: The lens; the centre of the top-left pixel is (0, 0), whatever the file counts from.
        what: What was read, in words: which model, and where the file begins to count pixels.
        name: What the file calls it; None if it does not.
        camera_from_previous: Where the camera that stands before it in the file is in it, where the file says so.
    """

    camera: Camera
    what: str
    name: str | None = None
    camera_from_previous: SE3 | None = None


def made_camera(field: Field, model: str, parameters: Sequence[float], size_px: tuple[int, int] | None) -> Camera:
    """The camera of fx, fy, cx, cy [px] and distortion terms that stand at a place of a file.

    Raises:
        DatasetError: if they are no lens.
    """
    try:
        return Camera(model, np.array(parameters, dtype=np.float64), size_px)
    except InputError as error:
        raise field.error(str(error)) from None


def opencv_terms(field: Field, terms: Sequence[float]) -> list[float]:
    """Distortion terms in OpenCV's order, without those of a sensor that is not tilted.

    Raises:
        DatasetError: if there is no lens of so many terms, or the sensor is tilted.
    """
    if len(terms) == _TILTED_TERMS:
        if any(terms[-2:]):
            raise field.error(
                "the last two of 14 terms tilt the sensor, which no lens here does: calibrate without them"
            )
        terms = terms[:-2]
    if len(terms) not in OPENCV_TERMS:
        known = " or ".join(map(str, (*OPENCV_TERMS, _TILTED_TERMS)))
        raise field.error(f"has {len(terms)} distortion terms, expected {known}, in OpenCV's order")
    return list(terms)


def matrix_parameters(field: Field, matrix: Sequence[float]) -> list[float]:
    """fx, fy, cx, cy of the nine numbers of a camera matrix, row by row.

    Raises:
        DatasetError: if they are none, or its axes are not at right angles.
    """
    fx, skew, cx, lower, fy, cy, *last = matrix
    if not any(matrix[:6]):
        raise field.error("is all zero: the camera is not calibrated; calibrate it, or leave its intrinsics free")
    if lower or list(last) != [0.0, 0.0, 1.0]:
        raise field.error("is not a camera matrix, row by row: fx 0 cx, 0 fy cy, 0 0 1; is it transposed?")
    if skew:
        raise field.error(f"has a skew of {skew:g} px, which no lens here has: calibrate without it")
    return [fx, fy, cx, cy]


def camera_entry(camera: Camera, status: str) -> dict[str, Any]:
    """Entry of `cell.yaml` for a lens: its model, size and intrinsics."""
    fx, fy, cx, cy, *terms = numbers(camera.parameters)
    size = {} if camera.size_px is None else {"size_px": list(camera.size_px)}
    lens = {"status": status, "fx": fx, "fy": fy, "cx": cx, "cy": cy, "distortion": terms}
    return {"model": camera.model, **size, "intrinsics": lens}
