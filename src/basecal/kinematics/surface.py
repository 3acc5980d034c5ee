"""Surfaces of bodies as coarse triangle meshes, for drawing."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import scipy  # submodules are loaded when they are first used

from basecal.errors import InputError
from basecal.geometry import Array, IntArray
from basecal.kinematics.collision import Collision, box_corners, mesh_file, shape_numbers, shape_with_pose
from basecal.kinematics.mesh import mesh_triangles

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

_GRID_CELLS = 12  # grid cells along the longest side of a mesh: vertices within a cell are merged
_CIRCLE_CORNERS = 16


class Surface(NamedTuple):
    """Triangles of a body.

    Attributes:
        frame: Frame of the body: 0 is the base, k the frame that rotates with joint k.
        points: (n, 3) points in this frame [m].
        triangles: (m, 3) rows of `points`.
    """

    frame: int
    points: Array
    triangles: IntArray


def body_surface(body: Collision) -> Surface:
    """Make the surface of a body; close vertices of a mesh are merged.

    Raises:
        InputError: if the body cannot be read, or its mesh is outside the cell's folder.
    """
    pose, shape = shape_with_pose(body)
    if shape.tag == "mesh":
        corners = mesh_triangles(mesh_file(shape, body)) * shape_numbers(shape.get("scale", "1 1 1"), 3)
        points, triangles = _coarsen(corners)
    else:
        points = _outer_points(shape)
        try:
            triangles = np.asarray(scipy.spatial.ConvexHull(points).simplices, dtype=np.int64)
        except scipy.spatial.QhullError:
            raise InputError(f"<{shape.tag}> has no volume") from None
    return Surface(body.frame, pose @ points, triangles)


def _outer_points(shape: Element) -> Array:
    """Points whose convex hull is a box, a cylinder or a sphere, (n, 3) [m]."""
    if shape.tag == "box":
        return box_corners(0.5 * np.outer([-1, 1], shape_numbers(shape.get("size", ""), 3)))
    angle = np.arange(_CIRCLE_CORNERS) * (2 * np.pi / _CIRCLE_CORNERS)
    radius = shape_numbers(shape.get("radius", ""), 1)
    circle = radius * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=-1)
    if shape.tag == "cylinder":
        half = 0.5 * shape_numbers(shape.get("length", ""), 1) * [0, 0, 1]
        return np.concatenate([circle - half, circle + half])
    heights = np.linspace(-1, 1, _CIRCLE_CORNERS // 2 + 1)[:, None, None]
    rings: Array = np.sqrt(1 - heights**2) * circle + heights * radius * [0, 0, 1]
    return rings.reshape(-1, 3)


def _coarsen(corners: Array) -> tuple[Array, IntArray]:
    """Merge the corners of triangles, (n, 3, 3), within each cell of a grid; return points and triangles."""
    flat = corners.reshape(-1, 3)
    low, extent = flat.min(0), np.ptp(flat, axis=0)
    cell = np.floor((flat - low) / max(float(extent.max()), 1e-9) * _GRID_CELLS).astype(np.int64)
    _, point = np.unique(cell @ [(_GRID_CELLS + 1) ** 2, _GRID_CELLS + 1, 1], return_inverse=True)
    count = np.bincount(point)
    points = np.stack([np.bincount(point, flat[:, axis]) / count for axis in range(3)], axis=-1)
    triangles = point.reshape(-1, 3)
    is_proper = np.all(triangles != np.roll(triangles, 1, axis=1), axis=1)
    _, first = np.unique(np.sort(triangles[is_proper], axis=1), axis=0, return_index=True)
    return points, triangles[is_proper][first]
