"""Reconstructions in the format of COLMAP, made from "Output Format" of its documentation."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from basecal.geometry import SE3


class Image(NamedTuple):
    """An image with its camera, and its pose up to scale."""

    name: str
    camera: int
    camera_from_world: SE3


def pose_numbers(pose: SE3) -> list[float]:
    """Return QW QX QY QZ TX TY TZ of a pose."""
    x, y, z, w = pose.quaternion
    return [float(each) for each in (w, x, y, z, *pose.translation)]


def text_images(images: Sequence[Image]) -> str:
    """Text of `images.txt`: a line of points follows every other image, and an empty line the others."""
    lines = [
        "# Image list with two lines of data per image:",
        "#   IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME",
    ]
    for k, image in enumerate(images):
        pose = " ".join(repr(each) for each in pose_numbers(image.camera_from_world))
        lines += [
            f"{k + 1} {pose} {image.camera} {image.name}",
            "2362.39 248.498 58396 1784.7 268.254 -1" if k % 2 else "",
        ]
    return "\n".join(lines) + "\n"


def binary_images(images: Sequence[Image]) -> bytes:
    """Content of `images.bin`, with k points for image k."""
    parts = [struct.pack("<Q", len(images))]
    for k, image in enumerate(images):
        parts.append(struct.pack("<I7dI", k + 1, *pose_numbers(image.camera_from_world), image.camera))
        parts.append(image.name.encode() + b"\0" + struct.pack("<Q", k) + struct.pack("<ddq", 1.0, 2.0, -1) * k)
    return b"".join(parts)


def write_reconstruction(folder: Path, images: Sequence[Image]) -> Path:
    """Write `images.txt` into a folder, and return the folder."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "images.txt").write_text(text_images(images), encoding="utf-8")
    return folder


IMAGES = [
    Image("wrist 10.png", 1, SE3.from_rpy((0.1, 0.2, -0.3), (0.5, -0.25, 2.0))),
    Image("wrist 9.png", 1, SE3.from_rpy((-0.4, 0.0, 2.3), (0.0, 0.125, 1.5))),
    Image("base.png", 2, SE3.from_rpy((0.0, 0.0, 1.0), (1.0, 2.0, 3.0))),
]
