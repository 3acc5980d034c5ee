"""The box that encloses a mesh file."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from basecal.bounded_file import read_bounded
from basecal.errors import DatasetError
from basecal.geometry import Array

_LARGEST_BYTES = 2**26  # 64 MB: collision meshes have some hundred kB
_HEADER_BYTES = 84  # of a binary STL, of which the last four are the number of triangles
_TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_VERTEX = re.compile(rb"^\s*v(?:ertex)?\s+(\S+)\s+(\S+)\s+(\S+)", re.MULTILINE)  # of a text STL, and of an OBJ


def mesh_bounds(path: Path) -> Array:
    """Least and largest coordinates of the vertices of a mesh, (2, 3), in its own unit.

    Args:
        path: An STL file, binary or text, or an OBJ file.

    Raises:
        DatasetError: if it cannot be read, or has no vertices, or one that is not finite.
    """
    data = read_bounded(path, _LARGEST_BYTES)
    count, odd = divmod(len(data) - _HEADER_BYTES, _TRIANGLE.itemsize)
    is_binary = not odd and count == int.from_bytes(data[_HEADER_BYTES - 4 : _HEADER_BYTES], "little")
    found = np.frombuffer(data, _TRIANGLE, offset=_HEADER_BYTES)["corners"] if is_binary else _VERTEX.findall(data)
    try:
        points = np.array(found, dtype=np.float64).reshape(-1, 3)
    except ValueError:
        points = np.full((1, 3), np.nan)
    if not (len(points) and np.isfinite(points).all()):
        raise DatasetError(str(path), "expected finite vertices of an STL or OBJ file")
    return np.stack([points.min(0), points.max(0)])
