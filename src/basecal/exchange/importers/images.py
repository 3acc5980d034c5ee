"""Import of folders of images."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from basecal.cell.targets.registry import TargetKindName
from basecal.errors import InputError, UsageError, count_text, list_names
from basecal.exchange.images import list_images, missing_numbers, read_times, unreadable_images, usual_size
from basecal.exchange.importing.described_target import UNSTATED_SHAPE, Shape, target_entry
from basecal.exchange.importing.imported import (
    Imported,
    PairingMethod,
    Row,
    ViewNames,
    carried_entry,
    check_robot,
    choose_carrier,
    known_cell,
    replaceable_size,
)
from basecal.fields.problems import Loc

_PAIRING_METHODS: dict[str, PairingMethod] = {"order": "order", "name": "image", "time": "stamp_s"}


def read_images(
    cell: str | Path,
    folder: str | Path,
    /,
    *,
    camera: str,
    on: str | None = None,
    by: Literal["order", "name", "time"] | None = None,
    link: bool = False,
    target: TargetKindName | None = None,
    target_on: str | None = None,
    target_name: str = "board",
    shape: Shape = UNSTATED_SHAPE,
    progress: Callable[[int, int], None] | None = None,
) -> Imported:
    """Copy one camera's images into a recording; several cameras need several calls.

    Image i, in the order of the names (2.png before 10.png), belongs to
    sample i. If a table had a column `image`, its names determine the samples. If
    nothing is recorded, each image becomes a sample. A camera that is not in the
    cell is added to it, with a free lens. The target in the images is added as
    well, if it is described here.

    For example:

        basecal import images mycell photos --camera wrist --on left \\
            --target charuco --squares 5x7 --square 40mm --target-on right
        basecal import images mycell /data/cam2 --camera door --on world --link

    Args:
        cell: Folder of the cell.
        folder: Folder of the images.
        camera: Name of the camera.
        on: Carrier of a new camera: a robot (its flange), or `world`; by default the only robot.
        by: Method of pairing images with samples: by order, by names in the recording, or by times in the file names.
        link: Make hard links instead of copies.
        target: Kind of the target in the images, if the cell does not describe it; its sizes are below.
        target_on: Carrier of the target: a robot (its flange), or `world`; by default the robot without the camera.
        target_name: Name of the target.
        shape: Counts and sizes of the target.
        progress: Called after each image with the number of images read and their total.

    Raises:
        UsageError: if a target is described without its kind.
        InputError: if no image can be read, or the carrier of camera or target is ambiguous.
    """
    if by is not None and by not in _PAIRING_METHODS:
        raise UsageError(f"by {by!r}: expected one of {list_names(list(_PAIRING_METHODS))}")
    files = list_images(Path(folder))
    new, replaced = _camera_entry(cell, camera, on)
    carrier = new["cameras"][camera].get("on")
    described = target_entry(cell, target, shape, ViewNames(camera, target_name, carrier, target_on))
    sizes = _read_images(Path(folder), files, progress)
    times = read_times(files) if by == "time" else [None] * len(files)
    rows = tuple(Row(images={camera: file}, image=file.name, stamp_s=t) for file, t in zip(files, times, strict=True))
    entry = {
        "robots": {name: {} for name in (*new.get("robots", {}), *described.get("robots", {}))},
        "cameras": {camera: {"size_px": list(sizes.size_px), **new["cameras"][camera]}},
        "targets": described.get("targets", {}),
    }
    return Imported(
        str(folder),
        _describe(len(rows), camera, sizes.size_px, carrier if on is None else None, entry["targets"]),
        rows,
        {key: value for key, value in entry.items() if value},
        replaced,
        by=None if by is None else _PAIRING_METHODS[by],
        is_linked=link,
        advice="check --camera",
        warnings=sizes.warnings,
    )


def _describe(
    count: int, camera: str, size_px: tuple[int, int], carrier: str | None, targets: dict[str, dict[str, Any]]
) -> str:
    """Description of the imported images; `carrier` is the assumed carrier of a new camera."""
    carried = "" if carrier is None else f", on {carrier!r}"
    advice = " (if it is beside the robot, correct `on: world` in cell.yaml)" if carried else ""
    described = [f"; target {name!r}, {each['kind']} on {each['on']!r}" for name, each in targets.items()]
    size = f"{size_px[0]} x {size_px[1]} px"
    return f"{count_text(count, 'image')} of {camera!r}{carried}, {size}{advice}{''.join(described)}"


@dataclass(frozen=True)
class _ImageSizes:
    """Most frequent size of images [px], and warnings about the others."""

    size_px: tuple[int, int]
    warnings: tuple[str, ...]


def _read_images(folder: Path, files: tuple[Path, ...], progress: Callable[[int, int], None] | None) -> _ImageSizes:
    """Read all images once to find their sizes and damaged files.

    Raises:
        InputError: if no image can be read.
    """
    from basecal.vision.image_file import grey_image, read_bytes  # needs OpenCV, other imports do not

    sizes: dict[str, tuple[int, int]] = {}
    damaged: list[str] = []
    for done, path in enumerate(files, start=1):
        image = grey_image(read_bytes(path), None)
        if isinstance(image, str):
            damaged.append(f"{path.name} {image}")
        else:
            sizes[path.name] = (image.shape[1], image.shape[0])
        if progress is not None:
            progress(done, len(files))
    if not sizes:
        raise InputError(f"{folder}: none of {len(files)} images can be read: {list_names(damaged)}")
    size_px = usual_size(list(sizes.values()))
    odd = [f"{name} ({size[0]} x {size[1]})" for name, size in sizes.items() if size != size_px]
    others = unreadable_images(folder)
    damaged_text = f"left out, as they cannot be read: {list_names(damaged)}"
    odd_text = f"left out, as most images have another size: {list_names(odd)}"
    gaps = missing_numbers([path.name for path in files])
    gaps_text = f"missing in the numbering of the images, check the tables of poses: {list_names(gaps)}"
    others_text = f"left out, as they are not images: {list_names(others)}"
    texts = ((damaged, damaged_text), (odd, odd_text), (others, others_text), (gaps, gaps_text))
    return _ImageSizes(size_px, tuple(f"{folder}: {text}" for names, text in texts if names))


def _camera_entry(folder: str | Path, name: str, stated_carrier: str | None) -> tuple[dict[str, Any], frozenset[Loc]]:
    """Entry of `cell.yaml` for the camera without its size, and the locations whose value may be replaced.

    Raises:
        InputError: if the carrier of a new camera is ambiguous, or the cell states another carrier.
    """
    known = known_cell(folder)
    carrier = choose_carrier(known, "camera", name, stated_carrier, may_be_world=False)
    check_robot(known, carrier)
    if name in known.cameras:
        return {"cameras": {name: {}}}, replaceable_size(folder, known, name)
    return carried_entry("cameras", name, carrier, intrinsics={"status": "free"}), frozenset()
