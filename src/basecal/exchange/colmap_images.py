"""Poses of the cameras of a reconstruction of COLMAP: `images.txt` or `images.bin`.

A pose is camera_from_world, up to scale; the camera's frame is OpenCV's. In the text each image has two lines, of which
the second holds its points and may be empty.
Source: COLMAP's documentation, "Output Format".
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from basecal.bounded_file import read_bounded
from basecal.errors import DatasetError
from basecal.exchange.columns import read_table_text
from basecal.exchange.fields import Field, written_number
from basecal.exchange.images import natural_order
from basecal.exchange.lens_files.colmap import reconstruction_file
from basecal.fields.problems import shorten
from basecal.geometry import SE3

_LARGEST = 2**30  # bytes: points of images, of which a binary holds all
_POINT_BYTES = 24
_LINE = "IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME"
_POSE_FIELDS = struct.Struct("<I7dI")
_UNIT_ERROR = 1e-3  # of a quaternion's length


class ReconstructedImage(NamedTuple):
    """The name of an image, the number of its camera, and its pose up to scale."""

    name: str
    camera: int
    camera_from_world: SE3


def read_colmap_images(path: str | Path) -> list[ReconstructedImage]:
    """The images of a reconstruction by their names.

    Args:
        path: `images.txt`, `images.bin`, or the folder that holds one of them; the binary is taken before the text.

    Raises:
        DatasetError: if it is neither, or holds no image.
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
            where = Field(str(path), words, {(): number})
            if len(words) < 10:
                raise where.error(f"{len(words)} words, expected {_LINE}")
            try:
                numbers, camera = [written_number(word) for word in words[1:8]], int(words[8])
            except ValueError:
                raise where.error(f"{shorten(line)} has a word that is not a number, expected {_LINE}") from None
            yield _image(where, words[9].strip(), camera, numbers)
        is_points = not is_points


def _binary(path: Path) -> Iterator[ReconstructedImage]:
    """Little-endian: how many, then number, pose, camera's number, name and points of each."""
    data = read_bounded(path, _LARGEST)
    cut = DatasetError(path, "is cut off, or is not images.bin of COLMAP")
    try:
        (count,), at = struct.unpack_from("<Q", data), 8
    except struct.error:
        raise cut from None
    for i in range(count):
        try:
            _, *numbers, camera = _POSE_FIELDS.unpack_from(data, at)
            end = data.find(b"\0", at + _POSE_FIELDS.size)
            (points,) = struct.unpack_from("<Q", data, end + 1)
        except struct.error:
            raise cut from None
        name, at = data[at + _POSE_FIELDS.size : end], end + 9 + _POINT_BYTES * points
        if end < 0 or at > len(data):
            raise cut
        yield _image(Field(str(path), None, {}, (f"image {i}",)), name.decode("utf-8", "replace"), camera, numbers)


def _image(place: Field, name: str, camera: int, numbers: Sequence[float]) -> ReconstructedImage:
    values = np.array(numbers)
    if not np.isfinite(values).all():
        raise place.error("holds a number that is not finite")
    if abs(np.linalg.norm(values[:4]) - 1) > _UNIT_ERROR:
        raise place.error(f"QW QX QY QZ has length {np.linalg.norm(values[:4]):.4g}, expected 1")
    return ReconstructedImage(name, camera, SE3.from_quaternion(values[[1, 2, 3, 0]], values[4:]))
