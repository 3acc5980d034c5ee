"""`basecal import images`."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from basecal.cli.described_target import UNSAID, Shape, target_entry
from basecal.cli.detected import counting
from basecal.cli.imported import By, finish_import
from basecal.cli.terminal import pasted, say
from basecal.errors import InputError, listed
from basecal.registry import TargetKindName

if TYPE_CHECKING:
    from basecal.cell import Cell

_BY: dict[str, By] = {"order": "order", "name": "image", "time": "stamp_s"}


def import_images(
    cell: Path,
    folder: Path,
    /,
    *,
    camera: str,
    on: str | None = None,
    by: Literal["order", "name", "time"] | None = None,
    link: bool = False,
    target: TargetKindName | None = None,
    target_on: str | None = None,
    target_name: str = "board",
    shape: Shape = UNSAID,
) -> int:
    """Copy one camera's pictures into a recording; several cameras by several calls.

    Picture i, in the order of their names (2.png before 10.png), belongs to
    sample i; where a table had a column `image`, its names say which. Where
    nothing is recorded, each picture makes a sample. A camera that is not in the
    cell is added to it, with a free lens. So is the target that the pictures show,
    where it is described here.

    For example:

        basecal import images mycell photos --camera wrist --on left \\
            --target charuco --squares 5x7 --square 40mm --target-on right
        basecal import images mycell /data/cam2 --camera door --on world --link

    Args:
        cell: Folder of the cell.
        folder: Folder of the pictures.
        camera: Name of the camera.
        on: What carries a camera that is new: a robot (its flange), or `world`; the robot where there is one alone.
        by: What pairs pictures with samples: their order, names in the recording, or times that their names are.
        link: Make hard links instead of copies.
        target: Kind of the target in the pictures, where the cell does not describe it; its sizes are below.
        target_on: What carries it: a robot (its flange), or `world`; if not said, the only robot without the camera.
        target_name: Its name.
        shape: Its counts and sizes.
    """
    from basecal.exchange.importing.imported import Imported, Row
    from basecal.exchange.pictures import pictures_of, stamp_of, unreadable_pictures

    entry, replaced = _camera_entry(cell, camera, on)
    files = pictures_of(folder)
    size_px = _checked_size(folder, files)
    said = entry["cameras"][camera]
    shown = target_entry(cell, target, shape, {target_name: target_on}, {camera: said.get("on")})
    entry["cameras"] = {camera: {key: said[key] for key in ("on",) if key in said} | {"size_px": list(size_px)} | said}
    stamps = [stamp_of(path.name) for path in files]
    if by == "time" and None in stamps:
        raise InputError(f"{files[stamps.index(None)]}: the name is no time, expected one such as 1682512345.123.png")
    rows = tuple(
        Row(pictures={camera: path}, image=path.name, stamp_s=stamp if by == "time" else None)
        for path, stamp in zip(files, stamps, strict=True)
    )
    if others := unreadable_pictures(folder):
        _warn(f"{folder}: {len(others)} files of other kinds are left out: {listed(others)}")
    carried = f", on {said['on']}" if on is None and "on" in said else ""
    advice = " (where it stands beside the robot, correct `on: world` in cell.yaml)" if carried else ""
    what = f"{len(rows)} pictures of {camera!r}{carried}, {size_px[0]} x {size_px[1]} px{advice}"
    for name, described in shown.get("targets", {}).items():
        what += f"; target {name!r}, {described['kind']} on {described['on']!r}"
    entry |= {"robots": {**entry.get("robots", {}), **shown.pop("robots", {})}} | shown if shown else {}
    imported = Imported(str(folder), what, rows, entry, replaced)
    return finish_import(cell, imported, advice="check --camera", by=None if by is None else _BY[by], link=link)


def _warn(text: str) -> None:
    say(f"basecal: warning: {text}", sys.stderr)


def _checked_size(folder: Path, files: tuple[Path, ...]) -> tuple[int, int]:
    """The size that the pictures have; those that cannot be read, or have another, are told.

    Raises:
        InputError: if none can be read.
    """
    from basecal.exchange.pictures import usual_size
    from basecal.vision.image_file import grey_image, read_bytes

    sizes: dict[str, tuple[int, int]] = {}
    damaged: list[str] = []
    with counting("reading pictures") as step:
        for done, path in enumerate(files, start=1):
            data = read_bytes(path)
            image = data if isinstance(data, str) else grey_image(data, None)
            if isinstance(image, str):
                damaged.append(f"{path.name} {image}")
            else:
                sizes[path.name] = (image.shape[1], image.shape[0])
            step(done, len(files))
    if not sizes:
        raise InputError(f"{folder}: none of {len(files)} pictures can be read: {listed(damaged)}")
    if damaged:
        _warn(
            f"{folder}: {len(damaged)} of {len(files)} pictures cannot be read, and will not be used: {listed(damaged)}"
        )
    size_px = usual_size(list(sizes.values()))
    if odd := [f"{name} ({size[0]} x {size[1]})" for name, size in sizes.items() if size != size_px]:
        _warn(f"{folder}: {len(odd)} pictures have another size than the rest, and will not be used: {listed(odd)}")
    return size_px


def _camera_entry(folder: Path, name: str, on: str | None) -> tuple[dict[str, Any], frozenset[tuple[str | int, ...]]]:
    """What `cell.yaml` must have for the camera but its size, and what it may lose: a size that nothing rests on.

    Raises:
        InputError: if the camera is new, and nobody says what carries it; or it is carried by something else.
    """
    from basecal.cell.files import read_cell

    path = folder / "cell.yaml"
    known = read_cell(folder) if path.exists() else None
    if known is not None and name in known.cameras:
        camera = known.cameras[name]
        if on is not None and on != camera.on:
            raise InputError(
                f"{path}: cameras.{name} is on {camera.on!r}, not on {on!r}: leave --on away, or correct it"
            )
        has_numbers = camera.intrinsics is not None and camera.intrinsics.camera is not None
        is_open = not has_numbers and not _is_recorded(folder, known, name)
        return {"cameras": {name: {}}}, frozenset({("cameras", name, "size_px")} if is_open else ())
    carrier = _carrier(folder, known, name, on)
    entry: dict[str, Any] = {"cameras": {name: {"on": carrier, "intrinsics": {"status": "free"}}}}
    if carrier != "world":
        entry = {"robots": {carrier: {}}, **entry}
    return ({"reference": carrier, **entry} if known is None else entry), frozenset()


def _carrier(folder: Path, known: Cell | None, name: str, on: str | None) -> str:
    """What carries a new camera."""
    if known is None and on in (None, "world"):
        make = f"import the robots' poses first, or basecal new {pasted(folder)}"
        if on == "world":
            raise InputError(f"{folder} has no cell.yaml, and so no robot in whose base {name!r} could stand: {make}")
        raise InputError(f"{folder} has no cell.yaml: say which robot carries {name!r}, as --on ROBOT; or {make}")
    if on is not None:
        return on
    robots = [] if known is None else list(known.robots)
    if len(robots) == 1:
        return robots[0]
    cameras = [] if known is None else list(known.cameras)
    there = f"cell.yaml has {listed(cameras)}; " if cameras else ""
    options = " or ".join(f"--on {each}" for each in [*robots, "world"])
    raise InputError(f"{folder} has no camera {name!r}: {there}to add it say what carries it, {options}")


def _is_recorded(folder: Path, cell: Cell, name: str) -> bool:
    from basecal.cell.files import read_recording

    if not (folder / "recording" / "samples.jsonl").exists():
        return False
    samples = read_recording(folder, cell).samples
    return any(name in s.images or any(o.camera == name for o in s.observations) for s in samples)
