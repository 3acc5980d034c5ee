"""A lens that a file states, as what an import brings into a cell."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

from basecal.cell.format.plain import pose_dict
from basecal.errors import InputError
from basecal.exchange.images import image_size
from basecal.exchange.importing.carriers import (
    KnownCell,
    NoCell,
    carried_entry,
    check_robot,
    choose_carrier,
    choose_name,
    known_cell,
    recorded_samples,
)
from basecal.exchange.importing.imported import Imported
from basecal.exchange.lens_files.stated_lens import StatedLens, camera_entry
from basecal.geometry import SE3

LensStatus = Literal["fixed", "free"]


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
