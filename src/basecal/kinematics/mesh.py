"""The box that encloses a mesh file."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from basecal.bounded_file import read_bounded
from basecal.errors import DatasetError
from basecal.geometry import Array

_LARGEST_BYTES = 2**26  # 64 MB: collision meshes have some hundred kB
_HEADER_BYTES = 84  # of a binary STL, the number of its triangles last
_TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_ROW = {".stl": rb"^\s*vertex\s+(.*)$", ".obj": rb"^v\s+(\S+\s+\S+\s+\S+)"}


def mesh_bounds(path: Path) -> Array:
    """Least and largest coordinates of the vertices of a mesh, (2, 3), in its own unit.

    Args:
        path: An STL file, binary or text, or an OBJ file.

    Raises:
        DatasetError: if the file is of another kind, cannot be read, or holds a vertex that is not finite.
    """
    row = _ROW.get(path.suffix.lower())
    if row is None:
        raise DatasetError(str(path), "is neither STL nor OBJ; convert it")
    data = read_bounded(path, _LARGEST_BYTES)
    count = int.from_bytes(data[_HEADER_BYTES - 4 : _HEADER_BYTES], "little")
    if path.suffix.lower() == ".stl" and len(data) == _HEADER_BYTES + count * _TRIANGLE.itemsize:
        points = np.frombuffer(data, _TRIANGLE, offset=_HEADER_BYTES)["corners"].reshape(-1, 3)
    else:
        try:
            points = np.array([words.split() for words in re.findall(row, data, re.MULTILINE)], dtype=np.float64)
        except ValueError:
            points = np.full((1, 3), np.nan)
    if points.ndim != 2 or points.shape[1:] != (3,) or not (len(points) and np.isfinite(points).all()):
        raise DatasetError(str(path), "expected vertices of three finite numbers")
    return np.stack([points.min(0), points.max(0)]).astype(np.float64)
