"""Locations of the transforms of a cell in `cell.yaml`, and entries that free them."""

from __future__ import annotations

from typing import Any

from basecal.cell import WORLD, Cell, Unknown
from basecal.cell.files import cell_to_dict
from basecal.fields.problems import Loc


def transform_place(cell: Cell, name: str) -> Loc | None:
    """Location of a transform in `cell.yaml`; None if it is part of another entry, such as a mark of a plate."""
    places: dict[str, Loc] = {cell.base_name(robot): ("bases", robot) for robot in cell.robots}
    places |= {cell.plate_name(plate): ("marks", plate, "mount") for plate in cell.plates}
    for mark in (target for target in cell.targets.values() if target.is_touched and target.on == WORLD):
        places[cell.mount_name(mark.name)] = ("marks", mark.name, "mount") if mark.contact else ("marks", mark.name)
    for target in (target for target in cell.targets.values() if not target.is_touched):
        places[cell.mount_name(target.name)] = ("targets", target.name, "mount")
    for camera in (camera for camera in cell.cameras.values() if not camera.touches):
        places[cell.mount_name(camera.name)] = ("cameras", camera.name, "mount")
    for tip in (camera for camera in cell.cameras.values() if camera.kind == "tip"):
        places[cell.mount_name(tip.name)] = ("tips", tip.name, "offset")
    return places.get(name)


def free_transform_entry(cell: Cell, name: str) -> dict[Loc, Any]:
    """Entry of `cell.yaml` that frees a transform; empty if the transform has no entry of its own."""
    place = transform_place(cell, name)
    return {} if place is None else {place: stated_value(cell.with_transform(name, Unknown("free")), place)}


def free_lens_entry(cell: Cell, camera: str) -> dict[Loc, Any]:
    """Entry of `cell.yaml` that frees the lens of a camera, with the stated lens as initial guess."""
    place: Loc = ("cameras", camera, "intrinsics")
    lens = cell.cameras[camera].intrinsics
    if lens is not None and lens.sigma is not None:
        stated = stated_value(cell, place)
        return {place: {**{key: value for key, value in stated.items() if "sigma" not in key}, "status": "free"}}
    exact = {"exact": False} if lens is not None and lens.exact else {}
    return {(*place, key): value for key, value in {"status": "free", **exact}.items()}


def stated_value(cell: Cell, place: Loc) -> Any:
    """Value at a location of the `cell.yaml` of a cell."""
    value: Any = cell_to_dict(cell)
    for key in place:
        value = value[key]
    return value
