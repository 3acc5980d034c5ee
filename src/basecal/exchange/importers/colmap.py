"""Import of a lens from a COLMAP reconstruction, or of its camera poses from `images.txt` or `images.bin`.

A pose is camera_from_world, up to scale; the camera's frame is OpenCV's. In the text file each image has two lines; the
second holds the image's points and may be empty.
Source: COLMAP's documentation, "Output Format".
"""

from __future__ import annotations

import struct
from collections import Counter
from collections.abc import Iterator, Sequence
from fnmatch import fnmatchcase
from pathlib import Path
from typing import NamedTuple

import numpy as np

from basecal.bounded_file import read_bounded
from basecal.errors import DatasetError, InputError, UsageError, count_text, list_names
from basecal.exchange.columns import read_table_text
from basecal.exchange.fields import Field, parse_float
from basecal.exchange.images import natural_order, read_times
from basecal.exchange.importing.imported import (
    Imported,
    Row,
    ViewNames,
    add_target_poses,
    choose_name,
    known_cell,
    view_entry,
)
from basecal.exchange.importing.lens import LensStatus, lens_of_file
from basecal.exchange.importing.pairing import plain_name
from basecal.exchange.lens_files.colmap import read_colmap_lenses, reconstruction_file
from basecal.fields.problems import shorten
from basecal.geometry import SE3

_LARGEST = 2**30  # bytes: a binary file includes all points of the images
_POINT_BYTES = 24
_LINE = "IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME"
_POSE_FIELDS = struct.Struct("<I7dI")
_UNIT_ERROR = 1e-3  # of a quaternion's length


def read_colmap(
    cell: str | Path,
    file: str | Path,
    /,
    *,
    camera: str | None = None,
    on: str | None = None,
    status: LensStatus = "fixed",
    camera_id: int | None = None,
    target: str | None = None,
    target_on: str | None = None,
    images: str = "*",
    streams: bool = False,
) -> Imported:
    """Import a camera's lens from a COLMAP reconstruction; with --target, its camera poses.

    With --target the reconstruction is a static target that is seen only as
    poses. images.txt or images.bin holds the pose of each image. The unit of
    length is unknown (`scale: free` in cell.yaml); `basecal calibrate` estimates
    it from the motion of the arms. Images are paired with samples by their
    names, or in the order of their names. With --streams the names are times,
    and each image becomes a separate line, as in a film of a moving arm. Two
    arms with images in one reconstruction are two cameras and one target.

    Reads cameras.txt or cameras.bin: SIMPLE_PINHOLE, PINHOLE, SIMPLE_RADIAL,
    RADIAL, OPENCV, FULL_OPENCV, OPENCV_FISHEYE, SIMPLE_RADIAL_FISHEYE and
    RADIAL_FISHEYE. Half a pixel is subtracted from the principal point, because
    COLMAP's origin is the corner of the image. The lens replaces the intrinsics
    in cell.yaml; its image size must be that of the recorded images.

    For example:

        basecal import colmap mycell sparse/0 --camera wrist
        basecal import colmap mycell sparse/0 --camera wrist --target room
        basecal import colmap mycell sparse/0 --camera wrist --target room \\
            --images "left/*"

    Args:
        cell: Folder of the cell.
        file: cameras.txt, cameras.bin, or the folder that holds one of them.
        camera: Name of the camera; may be omitted if the cell has one.
        on: Carrier of a new camera: a robot, or world.
        status: Whether the intrinsics are fixed, or free with these values as the initial guess.
        camera_id: Number of the camera, if the file has several.
        target: Name of the reconstructed target; its poses are read instead of the lens.
        target_on: Carrier of the target: the world, or a robot that moves it in front of a static camera.
        images: Pattern of the names of the camera's images in the reconstruction.
        streams: With --target: each image becomes a separate line at the time in its name.

    Raises:
        UsageError: if --streams is given without --target.
        InputError: if a file cannot be read, is inconsistent with the cell, or the images have another size.
    """
    if target is not None:
        known = known_cell(cell)
        names = ViewNames(choose_name("camera", camera, known.cameras), target, on, target_on)
        return _poses(cell, str(file), camera_id, images, names, streams)
    if streams:
        raise UsageError("--streams needs poses: add --target NAME")
    lenses = read_colmap_lenses(file)
    chosen = next(iter(lenses)) if camera_id is None and len(lenses) == 1 else camera_id
    if chosen is None or chosen not in lenses:
        raise InputError(f"{file} has cameras {list_names(list(map(str, lenses)))}: choose one with --camera-id")
    return lens_of_file(cell, lenses[chosen], file, camera, on, status)


def _poses(
    folder: str | Path, file: str, camera_id: int | None, pattern: str, names: ViewNames, is_stream: bool
) -> Imported:
    """Import the poses of the reconstruction in the frames of a camera's images."""
    cell, images = known_cell(folder), _select_images(file, camera_id, pattern)
    entry = view_entry(cell, names)
    if names.target not in cell.targets:
        entry["targets"][names.target]["scale"] = "free"
    times = read_times([Path(image.name) for image in images]) if is_stream else ()
    rows = tuple(Row(stamp_s=time) for time in times) or tuple(Row(image=image.name) for image in images)
    poses = SE3.stack([image.camera_from_world for image in images])
    what = f"{len(images)} poses {names.camera}_from_{names.target}, up to scale"
    advice = "check that images belong to samples"
    return Imported(file, what, add_target_poses(rows, poses, names), entry, is_stream=is_stream, advice=advice)


def _select_images(file: str, camera_id: int | None, pattern: str) -> list[ReconstructedImage]:
    """Select the images of one camera.

    Raises:
        InputError: if the camera is ambiguous or has no images, or two images have the same name.
    """
    images = read_colmap_images(file)
    named = [image for image in images if fnmatchcase(image.name, pattern)]
    if not named:
        raise InputError(f"{file}: no image is named {pattern}; its images: {list_names([i.name for i in images])}")
    numbers = list_names([str(number) for number in sorted({image.camera for image in named})])
    chosen = [image for image in named if camera_id in (None, image.camera)]
    if len({image.camera for image in chosen}) != 1:
        raise InputError(f"{file} has images of cameras {numbers}: choose one with --camera-id")
    repeated = [name for name, count in Counter(plain_name(image.name) for image in chosen).items() if count > 1]
    if repeated:
        folder = chosen[0].name.rpartition("/")[0] or "FOLDER"
        raise InputError(
            f'{file}: images {list_names(repeated)} are in several folders: choose one by --images "{folder}/*"'
        )
    return chosen


class ReconstructedImage(NamedTuple):
    """An image's name, camera number, and pose up to scale."""

    name: str
    camera: int
    camera_from_world: SE3


def read_colmap_images(path: str | Path) -> list[ReconstructedImage]:
    """Read the images of a reconstruction, sorted by name.

    Args:
        path: `images.txt`, `images.bin`, or the folder that holds one of them; the binary file is preferred.

    Raises:
        DatasetError: if the file is invalid or has no image.
    """
    file = reconstruction_file(path, "images")
    images = list(_binary(file) if file.suffix.lower() == ".bin" else _text(file))
    if not images:
        raise DatasetError(file, f"holds no image, expected lines `{_LINE}`")
    return sorted(images, key=lambda image: natural_order(Path(image.name)))


def _text(path: Path) -> Iterator[ReconstructedImage]:
    lines = read_table_text(str(path), f"lines `{_LINE}`").splitlines()
    is_points = False
    for number, line in enumerate(lines, start=1):
        if line.startswith("#") or (not is_points and not line.strip()):
            continue
        if not is_points:
            words = line.split(maxsplit=9)
            location = Field(str(path), words, {(): number})
            if len(words) < 10:
                raise location.error(f"{count_text(len(words), 'word')}, expected {_LINE}")
            try:
                numbers, camera = [parse_float(word) for word in words[1:8]], int(words[8])
            except ValueError:
                raise location.error(f"{shorten(line)} has a word that is not a number, expected {_LINE}") from None
            yield _image(location, words[9].strip(), camera, numbers)
        is_points = not is_points


def _binary(path: Path) -> Iterator[ReconstructedImage]:
    """Parse the little-endian file: image count, then id, pose, camera id, name and points of each image."""
    data = read_bounded(path, _LARGEST)
    cut_off = DatasetError(path, "is cut off, or is not images.bin of COLMAP")
    try:
        (count,), offset = struct.unpack_from("<Q", data), 8
    except struct.error:
        raise cut_off from None
    for i in range(count):
        try:
            _, *numbers, camera = _POSE_FIELDS.unpack_from(data, offset)
            end = data.find(b"\0", offset + _POSE_FIELDS.size)
            (points,) = struct.unpack_from("<Q", data, end + 1)
        except struct.error:
            raise cut_off from None
        name, offset = data[offset + _POSE_FIELDS.size : end], end + 9 + _POINT_BYTES * points
        if end < 0 or offset > len(data):
            raise cut_off
        yield _image(Field(str(path), None, {}, (f"image {i}",)), name.decode("utf-8", "replace"), camera, numbers)


def _image(location: Field, name: str, camera: int, numbers: Sequence[float]) -> ReconstructedImage:
    values = np.array(numbers)
    if not np.isfinite(values).all():
        raise location.error("holds a number that is not finite")
    if abs(np.linalg.norm(values[:4]) - 1) > _UNIT_ERROR:
        raise location.error(f"QW QX QY QZ has length {np.linalg.norm(values[:4]):.4g}, expected 1")
    return ReconstructedImage(name, camera, SE3.from_quaternion(values[[1, 2, 3, 0]], values[4:]))
