"""Capsules that enclose bodies: the <collision> elements of a URDF, and boxes."""

from __future__ import annotations

from dataclasses import dataclass
from os.path import isfile
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from basecal.errors import InputError
from basecal.geometry import SE3, Array, IntArray
from basecal.kinematics.mesh import mesh_bounds

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element


_CAPSULE_WIDTH_M, _MOST_CAPSULES = 0.08, 8  # largest width of a box per capsule [m]; most capsules across a box
_LARGEST_VALUE = 1e3  # largest valid number [m, rad]


@dataclass(frozen=True, eq=False)
class Collision:
    """A <collision> element, which is read when it is needed.

    Attributes:
        link: Name of the link.
        frame: Frame that the link is fixed to: 0 is the base, k the frame that rotates with joint k.
        frame_from_link: Pose of the link in this frame.
        element: The XML element.
        urdf: The URDF file.
        folder: Folder that contains all meshes.
    """

    link: str
    frame: int
    frame_from_link: SE3
    element: Element
    urdf: Path
    folder: Path


class Capsules(NamedTuple):
    """k capsules, segments with a radius, that enclose bodies.

    Attributes:
        frame: (k,) frame of each capsule: 0 is the base, j rotates with joint j, n + 1 is the flange.
        ends: (k, 2, 3) ends of the segments in this frame [m].
        radius: (k,) radii [m].
        padding: (k,) amount by which a body may be larger than its capsule [m].
    """

    frame: IntArray
    ends: Array
    radius: Array
    padding: Array


def box_capsules(frame: int, pose: SE3, bounds: Array, padding_m: float = 0.0) -> Capsules:
    """Enclose a box by capsules along its longest side.

    Args:
        frame: Frame of the box; see `Capsules`.
        pose: Pose of the box's axes in the frame.
        bounds: (2, 3) least and largest coordinates along these axes [m].
        padding_m: Amount by which the body may be larger than the box [m].
    """
    size = bounds[1] - bounds[0]
    counts = np.clip(np.ceil(size / _CAPSULE_WIDTH_M), 1, _MOST_CAPSULES)
    counts[np.argmax(size)] = 1
    half = 0.5 * size / counts
    cells = np.stack(np.meshgrid(*(np.arange(count) for count in counts), indexing="ij"), -1).reshape(-1, 3)
    half_axis = np.where(np.arange(3) == np.argmax(size), half, 0.0)
    middles = bounds[0] + (2 * cells + 1) * half
    ends = pose @ np.stack([middles - half_axis, middles + half_axis], axis=1)
    radius, padding = (np.full(len(ends), value) for value in (np.linalg.norm(half - half_axis), padding_m))
    return Capsules(np.full(len(ends), frame), ends, radius, padding)


def box_corners(bounds: Array) -> Array:
    """Corners of a box, (8, 3), from its least and largest coordinates, (2, 3)."""
    return np.stack(np.meshgrid(*bounds.T, indexing="ij"), -1).reshape(-1, 3)


def body_capsules(body: Collision) -> Capsules:
    """Enclose a body by capsules.

    Raises:
        InputError: if the body cannot be read, or its mesh is outside the cell's folder.
    """
    pose, shape = shape_with_pose(body)
    if shape.tag == "mesh":
        bounds = mesh_bounds(mesh_file(shape, body))
        return box_capsules(body.frame, pose, np.sort(bounds * shape_numbers(shape.get("scale", "1 1 1"), 3), axis=0))
    if shape.tag == "box":
        return box_capsules(body.frame, pose, 0.5 * np.outer([-1, 1], abs(shape_numbers(shape.get("size", ""), 3))))
    radius = abs(shape_numbers(shape.get("radius", ""), 1))
    length = shape_numbers(shape.get("length", "0"), 1)
    ends = pose @ (np.outer([-0.5, 0.5], [0, 0, 1]) * length)
    return Capsules(np.array([body.frame]), ends[None], radius, np.zeros(1))


def shape_with_pose(body: Collision) -> tuple[SE3, Element]:
    """Pose of a body's shape in its frame, and the element of the shape.

    Raises:
        InputError: if the body has no shape, or the numbers of its origin are invalid.
    """
    origin, shape = body.element.find("origin"), body.element.find("geometry/*")
    if shape is None:
        raise InputError("<collision> has no geometry")
    words = {} if origin is None else origin.attrib
    pose = SE3.from_rpy(shape_numbers(words.get("rpy", "0 0 0"), 3), shape_numbers(words.get("xyz", "0 0 0"), 3))
    return body.frame_from_link @ pose, shape


def shape_numbers(text: str, count: int) -> Array:
    """Parse the numbers of an attribute, (count,).

    Raises:
        InputError: if their number is not `count`, one is not finite, or one is beyond 1e3.
    """
    numbers = numbers_in_text(text, count, _LARGEST_VALUE)
    if numbers is None:
        raise InputError(f"<collision> has {text!r}, expected finite numbers: {count} within {_LARGEST_VALUE:g}")
    return numbers


def numbers_in_text(text: str, count: int, largest: float) -> Array | None:
    """Parse `count` numbers, (count,); None if their number differs, one is not finite, or one is beyond `largest`."""
    try:
        numbers = np.array([float(word) for word in text.split()])
    except ValueError:
        return None
    return numbers if len(numbers) == count and np.all(np.abs(numbers) <= largest) else None


def mesh_file(shape: Element, body: Collision) -> Path:
    """Find the file of a body's mesh, with or without the package name, in the URDF's folder or a parent folder.

    Raises:
        InputError: if there is no such file inside the cell's folder.
    """
    name = shape.get("filename", "")
    relative = Path(name.removeprefix("package://").removeprefix("file://"))
    for folder in body.urdf.resolve().parents:
        for part in (relative, Path(*relative.parts[1:])):
            path = (folder / part).resolve()
            if isfile(path) and path.is_relative_to(body.folder.resolve()):
                return path
    raise InputError(f"mesh {name!r} is not in the cell's folder; copy it there")
