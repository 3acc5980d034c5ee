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


_ROD_M, _MOST_RODS = 0.08, 8  # widest part of a box that one capsule encloses; most of them across it
_LARGEST_VALUE = 1e3  # [m, rad] of any number


@dataclass(frozen=True, eq=False)
class Collision:
    """A <collision> element, read when it is needed.

    Attributes:
        link: Name of its link.
        frame: What carries it: 0 is the base, k the frame that turns with joint k.
        frame_from_link: Pose of the link.
        element: The element.
        urdf: The file.
        folder: That holds all meshes.
    """

    link: str
    frame: int
    frame_from_link: SE3
    element: Element
    urdf: Path
    folder: Path


class Capsules(NamedTuple):
    """Segments with a radius, k of them, that enclose what is known of bodies.

    Attributes:
        frame: (k,) what carries each: 0 is the base, j turns with joint j, n + 1 is the flange.
        ends: (k, 2, 3) [m] in that frame.
        radius: (k,) [m].
        padding: (k,) [m] by which a body may be larger than what is known.
    """

    frame: IntArray
    ends: Array
    radius: Array
    padding: Array


def box_capsules(frame: int, pose: SE3, bounds: Array, padding_m: float = 0.0) -> Capsules:
    """Capsules along the longest side of a box that enclose it.

    Args:
        frame: What carries the box.
        pose: Of the axes that its sides are parallel to, in the frame.
        bounds: (2, 3) its least and largest coordinates along these axes [m].
        padding_m: By which the body may be larger.
    """
    size = bounds[1] - bounds[0]
    counts = np.clip(np.ceil(size / _ROD_M), 1, _MOST_RODS)
    counts[np.argmax(size)] = 1
    half = 0.5 * size / counts
    cells = np.stack(np.meshgrid(*(np.arange(count) for count in counts), indexing="ij"), -1).reshape(-1, 3)
    along = np.where(np.arange(3) == np.argmax(size), half, 0.0)
    middles = bounds[0] + (2 * cells + 1) * half
    ends = pose @ np.stack([middles - along, middles + along], axis=1)
    radius, padding = (np.full(len(ends), value) for value in (np.linalg.norm(half - along), padding_m))
    return Capsules(np.full(len(ends), frame), ends, radius, padding)


def box_corners(bounds: Array) -> Array:
    """Corners of a box between its least and largest coordinates, (2, 3), as (8, 3)."""
    return np.stack(np.meshgrid(*bounds.T, indexing="ij"), -1).reshape(-1, 3)


def body_capsules(body: Collision) -> Capsules:
    """Capsules that enclose a body.

    Raises:
        InputError: if it cannot be read, or lies outside of the cell's folder.
    """
    pose, shape = placed_shape(body)
    if shape.tag == "mesh":
        bounds = mesh_bounds(mesh_file(shape, body))
        return box_capsules(body.frame, pose, np.sort(bounds * shape_numbers(shape.get("scale", "1 1 1"), 3), axis=0))
    if shape.tag == "box":
        return box_capsules(body.frame, pose, 0.5 * np.outer([-1, 1], abs(shape_numbers(shape.get("size", ""), 3))))
    radius = abs(shape_numbers(shape.get("radius", ""), 1))
    length = shape_numbers(shape.get("length", "0"), 1)
    ends = pose @ (np.outer([-0.5, 0.5], [0, 0, 1]) * length)
    return Capsules(np.array([body.frame]), ends[None], radius, np.zeros(1))


def placed_shape(body: Collision) -> tuple[SE3, Element]:
    """Where a body's shape is in the frame that carries it, and its element.

    Raises:
        InputError: if it has none, or its origin is no numbers.
    """
    origin, shape = body.element.find("origin"), body.element.find("geometry/*")
    if shape is None:
        raise InputError("<collision> has no geometry")
    words = {} if origin is None else origin.attrib
    pose = SE3.from_rpy(shape_numbers(words.get("rpy", "0 0 0"), 3), shape_numbers(words.get("xyz", "0 0 0"), 3))
    return body.frame_from_link @ pose, shape


def shape_numbers(text: str, count: int) -> Array:
    """Numbers of an attribute, (count,).

    Raises:
        InputError: if they are not finite, or not so many.
    """
    numbers = numbers_in_text(text, count, _LARGEST_VALUE)
    if numbers is None:
        raise InputError(f"<collision> has {text!r}, expected finite numbers: {count}")
    return numbers


def numbers_in_text(text: str, count: int, largest: float) -> Array | None:
    """Numbers of an attribute, (count,); None if they are not so many, not finite, or one is beyond the largest."""
    try:
        numbers = np.array([float(word) for word in text.split()])
    except ValueError:
        return None
    return numbers if len(numbers) == count and np.all(np.abs(numbers) <= largest) else None


def mesh_file(shape: Element, body: Collision) -> Path:
    """The file of a body's mesh, with or without its package's name, in the URDF's folder or one above it.

    Raises:
        InputError: if it is not in the cell's folder.
    """
    name = shape.get("filename", "")
    whole = Path(name.removeprefix("package://").removeprefix("file://"))
    for folder in body.urdf.resolve().parents:
        for part in (whole, Path(*whole.parts[1:])):
            path = (folder / part).resolve()
            if isfile(path) and path.is_relative_to(body.folder.resolve()):
                return path
    raise InputError(f"mesh {name!r} is not in the cell's folder; copy it there")
