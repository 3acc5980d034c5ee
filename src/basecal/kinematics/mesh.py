"""Read triangles and bounding boxes of mesh files."""

from __future__ import annotations

import re
from itertools import pairwise
from pathlib import Path

import numpy as np

from basecal.bounded_file import read_bounded
from basecal.errors import DatasetError
from basecal.geometry import Array

_LARGEST_BYTES = 2**26  # 64 MB: collision meshes have some hundred kB
_HEADER_BYTES = 84  # header of a binary STL; its last four bytes are the number of triangles
_TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_VERTEX = re.compile(rb"^\s*v(?:ertex)?\s+(\S+)\s+(\S+)\s+(\S+)", re.MULTILINE)  # vertex of a text STL or an OBJ
_FACE = re.compile(rb"^[ \t]*f((?:[ \t]+-?\d+(?:/-?\d*){0,2}){3,})[ \t]*\r?$", re.MULTILINE)  # face of an OBJ


def mesh_bounds(path: Path) -> Array:
    """Least and largest coordinates of the vertices of a mesh, (2, 3), in the unit of the file.

    Args:
        path: An STL file, binary or text, or an OBJ file.

    Raises:
        DatasetError: if the file cannot be read, has no vertices, or has a non-finite vertex.
    """
    points = _vertices(path, read_bounded(path, _LARGEST_BYTES))
    return np.stack([points.min(0), points.max(0)])


def mesh_triangles(path: Path) -> Array:
    """Corners of the triangles of a mesh, (n, 3, 3), in the unit of the file.

    Raises:
        DatasetError: as in `mesh_bounds`, or if a face refers to a vertex that does not exist.
    """
    data = read_bounded(path, _LARGEST_BYTES)
    points = _vertices(path, data)
    faces = [[int(word.split(b"/")[0]) for word in face.split()] for face in _FACE.findall(data)]
    if not faces:
        return points[: len(points) // 3 * 3].reshape(-1, 3, 3)
    rows = np.array([(face[0], *pair) for face in faces for pair in pairwise(face[1:])]).reshape(-1, 3)
    rows = np.where(rows < 0, rows + len(points), rows - 1)  # negative numbers count from the end
    if not np.all((rows >= 0) & (rows < len(points))):
        raise DatasetError(str(path), f"expected faces of vertices 1 to {len(points)}")
    corners: Array = points[rows]
    return corners


def _vertices(path: Path, data: bytes) -> Array:
    """Read the vertices in the order of the file, (n, 3); an STL has three per triangle."""
    count, odd = divmod(len(data) - _HEADER_BYTES, _TRIANGLE.itemsize)
    is_binary = not odd and count == int.from_bytes(data[_HEADER_BYTES - 4 : _HEADER_BYTES], "little")
    found = np.frombuffer(data, _TRIANGLE, offset=_HEADER_BYTES)["corners"] if is_binary else _VERTEX.findall(data)
    try:
        points = np.array(found, dtype=np.float64).reshape(-1, 3)
    except ValueError:
        points = np.full((1, 3), np.nan)
    if not (len(points) and np.isfinite(points).all()):
        raise DatasetError(str(path), "expected finite vertices of an STL or OBJ file")
    return points
