"""A lens that a file states, as what an import brings into a cell."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

from basecal.cell import WORLD, Cell
from basecal.cell.format.plain import pose_dict
from basecal.errors import InputError, list_names
from basecal.exchange.images import image_size
from basecal.exchange.importing.cell_content import known_cell, recorded_samples
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
    """The lens of a camera, for the cell in a folder; see `imported_lens`.

    Raises:
        InputError: if it does not fit the cell, or the recorded images have another size.
    """
    cell = known_cell(folder)
    if cell is not None and lens.camera.size_px is not None:
        _check_images(Path(folder), cell, chosen_camera(cell, camera), lens.camera.size_px, str(file))
    return imported_lens(cell, lens, str(file), camera, carrier, status, mount)


def _check_images(folder: Path, cell: Cell, camera: str, size_px: tuple[int, int], source: str) -> None:
    """Raise an InputError if the first image of the camera has another size."""
    samples = recorded_samples(folder, cell)
    image = next((sample.images[camera] for sample in samples if camera in sample.images), None)
    size = None if image is None else image_size(folder / image)
    if size is not None and size != tuple(size_px):
        sizes = f"{source} is of {size_px[0]} x {size_px[1]} px, {image} has {size[0]} x {size[1]}"
        raise InputError(f"{sizes}: import the calibration of images of this size; a lens cannot be carried over")


def imported_lens(
    cell: Cell | None,
    lens: StatedLens,
    source: str,
    camera: str | None,
    carrier: str | None,
    status: LensStatus,
    mount: SE3 | None = None,
) -> Imported:
    """The lens of a camera: its model, size and intrinsics stand in for what the cell says of them.

    Args:
        cell: The cell there is; None if one is made.
        lens: What was read.
        source: The file, as the user named it.
        camera: Name of the camera; the only one of the cell where None.
        carrier: The robot that carries it, or `world`; what the cell says where None.
        status: `fixed`, or `free`: a start for intrinsics that are estimated.
        mount: Where it is roughly, in what carries it; None if not known.

    Raises:
        InputError: if it is not clear which camera it is or what carries it, or the cell says another size.
    """
    name = chosen_camera(cell, camera)
    entry = camera_entry(lens.camera, status)
    known = None if cell is None else cell.cameras.get(name)
    if known is not None:
        size, said = lens.camera.size_px, known.size_px
        if size is not None and said is not None and tuple(size) != tuple(said):
            sizes = f"{source} is of {size[0]} x {size[1]} px, camera {name!r} in cell.yaml of {said[0]} x {said[1]}"
            raise InputError(f"{sizes}: import the calibration of the images' size, or correct size_px")
    data: dict[str, Any] = {"cameras": {name: entry}}
    if known is None:
        data = _camera_data(cell, name, carrier)
        data["cameras"] = {name: {**data["cameras"][name], **entry}}
    if mount is not None and (known is None or (known.mount.status == "free" and known.mount.mean is None)):
        data["cameras"][name]["mount"] = {"status": "free", "guess": pose_dict(mount)}
    places = frozenset({("cameras", name, "model"), ("cameras", name, "intrinsics")})
    what = f"{lens.what}; written as {status} intrinsics of camera {name!r}"
    return Imported(source, what, cell=data, replaced=places, advice="check that the file is of this camera")


def chosen_camera(cell: Cell | None, camera: str | None) -> str:
    """Name of the camera that an import is for.

    Raises:
        InputError: if none is named and the cell has none, or several.
    """
    if camera is not None:
        return camera
    if cell is None:
        return "camera"
    if len(cell.cameras) != 1:
        raise InputError(f"which camera? --camera NAME; the cell has {list_names(list(cell.cameras))}")
    return next(iter(cell.cameras))


def _camera_data(cell: Cell | None, camera: str, carrier: str | None) -> dict[str, Any]:
    """The data of a camera that is new to a cell, and of a cell that is new."""
    if cell is not None:
        if carrier is None and len(cell.cameras) == 0 and len(cell.robots) == 1:
            carrier = next(iter(cell.robots))
        if carrier is None or (carrier != WORLD and carrier not in cell.robots):
            known = list_names([*cell.robots, WORLD])
            raise InputError(f"camera {camera!r} is not in cell.yaml: say what carries it, --on one of {known}")
        return {"cameras": {camera: _carrier_data(carrier)}}
    if carrier == WORLD:
        raise InputError(f"there is no cell.yaml to put camera {camera!r} into: `basecal new`, or --on ROBOT makes one")
    robot = carrier or "eye"
    return {"robots": {robot: {}}, "cameras": {camera: _carrier_data(robot)}}


def _carrier_data(carrier: str) -> Mapping[str, Any]:
    return {"on": carrier, "mount": {"status": "free"}}


def mount_by_chain(cell: Cell | None, lenses: Sequence[StatedLens], name: str) -> SE3 | None:
    """Where a camera of a chain is, in what carries it; None if the cell does not know the one before it.

    Args:
        cell: The cell there is, whose cameras have the names of the chain's.
        lenses: The chain.
        name: Of the camera in the chain.
    """
    names = [lens.name for lens in lenses]
    place = names.index(name)
    before = None if cell is None or place == 0 else cell.cameras.get(str(names[place - 1]))
    camera_from_previous = lenses[place].camera_from_previous
    if before is None or before.mount.mean is None or camera_from_previous is None:
        return None
    return before.mount.mean @ camera_from_previous.inverse()


def imported_target(
    cell: Cell | None, target: Mapping[str, Any], source: str, name: str | None, carrier: str | None
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
    if cell is None:
        raise InputError(
            f"there is no cell.yaml to put the target of {source} into: basecal new, or import poses first"
        )
    if name is None:
        name = next(iter(cell.targets), "target")
        if len(cell.targets) > 1:
            raise InputError(f"which target? --target is one of: {list_names(list(cell.targets))}")
    entry: dict[str, Any] = dict(target)
    if name not in cell.targets:
        if carrier is None or (carrier != WORLD and carrier not in cell.robots):
            known = list_names([*cell.robots, WORLD])
            raise InputError(f"target {name!r} is not in cell.yaml: say what carries it, --on one of {known}")
        entry = {**_carrier_data(carrier), **entry}
    sizes = ", ".join(f"{key} {value}" for key, value in target.items() if key != "kind")
    what = f"a target, {target['kind']}: {sizes}"
    return Imported(source, what, cell={"targets": {name: entry}}, advice="check its sizes")
