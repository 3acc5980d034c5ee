"""Stacks of poses as other programs write them: 4x4 text, NumPy archives and CSV."""

from __future__ import annotations

from array import array
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from io import StringIO
from pathlib import Path
from typing import Literal

import numpy as np

from basecal.errors import DatasetError, InputError, list_names
from basecal.exchange.columns import MOST_POSES, read_columns, read_table_text
from basecal.exchange.fields import written_number
from basecal.exchange.npz import read_arrays
from basecal.fields.problems import shorten
from basecal.fields.values import LARGEST_VALUE
from basecal.geometry import SE3, Array

LengthUnit = Literal["m", "mm", "inch"]
METRES: dict[LengthUnit, float] = {"m": 1.0, "mm": 1e-3, "inch": 0.0254}
"""Of a length in a unit."""

_QUATERNION = ("x", "y", "z", "qx", "qy", "qz", "qw")
_MATRIX = tuple(f"m{row}{column}" for row in range(3) for column in range(4))
_ALIASES = {
    "x": ("t_x", "tx", "x_m", "x_mm"),
    "y": ("t_y", "ty", "y_m", "y_mm"),
    "z": ("t_z", "tz", "z_m", "z_mm"),
    **{f"q{axis}": (f"q_{axis}",) for axis in "xyzw"},
    "stamp_s": ("stamp", "time_s", "time", "t"),
}
_ACCEPTED = (
    "a CSV file needs a header that names x, y, z, qx, qy, qz, qw (or t_x ..., q_x ...), or m00 ... m23 row by row, "
    "and may name stamp_s"
)


def unit_length_m(unit: str) -> float:
    """The length of a unit [m].

    Raises:
        InputError: if there is no such unit.
    """
    known = {str(name): size for name, size in METRES.items()}
    if unit not in known:
        raise InputError(f"length unit {unit!r}: expected one of {list_names(list(known))}")
    return known[unit]


@dataclass(frozen=True, eq=False)
class PoseStream:
    """Poses from one file, in its order.

    Attributes:
        path: Where they were read.
        poses: (n,) transforms, lengths in metres.
        stamps_s: (n,) times; None if the file has none.
    """

    path: str
    poses: SE3
    stamps_s: Array | None = None


def read_poses(path: str | Path, length_unit: LengthUnit) -> PoseStream:
    """Poses of a file whose name ends in `.csv`, `.npz`, `.npz:key` or `.npy`; any other is 4x4 text.

    Args:
        path: The file; an archive of several arrays needs `file.npz:key`.
        length_unit: What its translations are in; no file says so itself.

    Raises:
        DatasetError: naming the file and the row, if it holds anything else than poses.
    """
    name = str(path)
    if name.lower().endswith(".csv"):
        stream = _from_csv(name)
    elif ".npz" in name.lower() or name.lower().endswith(".npy"):
        poses = _make_poses(_from_archive(name), _matrix_pose, name, lambda i: (None, f"matrix {i}"))
        stream = PoseStream(name, poses)
    else:
        matrices, lines = _from_text(name)
        stream = PoseStream(name, _make_poses(matrices, _matrix_pose, name, lambda i: (lines[4 * i], None)))
    scaled = SE3(stream.poses.rotation, stream.poses.translation * unit_length_m(length_unit))
    return replace(stream, poses=scaled)


def _make_poses(
    rows: Array, make: Callable[[Array], SE3], path: str, place: Callable[[int], tuple[int | None, str | None]]
) -> SE3:
    """`make` of every row; an error says which one by `place`, a line and a field."""
    if len(rows) > MOST_POSES:
        raise DatasetError(path, f"{len(rows)} poses, expected at most {MOST_POSES}")
    found = []
    for i, row in enumerate(rows):
        try:
            found.append(make(row))
        except InputError as error:
            raise DatasetError(path, str(error), *place(i)) from None
        if not np.all(np.abs(found[-1].translation) <= LARGEST_VALUE):
            raise DatasetError(path, f"a translation is beyond {LARGEST_VALUE:g}: is this the length unit?", *place(i))
    return SE3.stack(found)


def _matrix_pose(matrix: Array) -> SE3:
    return SE3.from_matrix(matrix, "pose")


def _from_text(path: str) -> tuple[Array, Sequence[int]]:
    whole = read_table_text(path, "rows of 4 numbers, or a name that ends in .csv or .npz")
    # As bytes, since lists of lists take forty times as much.
    values, lines = array("d"), array("q")
    for number, text in enumerate(StringIO(whole), start=1):
        words = text.split("#")[0].replace(",", " ").split()
        if not words:
            continue
        if len(words) != 4:
            raise DatasetError(
                path, f"{len(words)} numbers, expected rows of 4: 4x4 matrices one below the other", number
            )
        try:
            values.extend([written_number(word) for word in words])
        except ValueError:
            raise DatasetError(path, f"not a row of numbers: {shorten(' '.join(words))}", number) from None
        lines.append(number)
    if not lines or len(lines) % 4:
        raise DatasetError(path, f"{len(lines)} rows of numbers, expected 4 for every 4x4 matrix, at least one matrix")
    return np.array(values).reshape(-1, 4, 4), lines


def _from_archive(path: str) -> Array:
    name, arrays = read_arrays(path)
    if len(arrays) != 1:
        raise DatasetError(
            name, f"holds {', '.join(arrays) or 'nothing'}; say which, as {name}:{next(iter(arrays), 'key')}"
        )
    (key, matrices), *_ = arrays.items()
    if matrices.ndim != 3 or matrices.shape[1:] != (4, 4) or not len(matrices):
        raise DatasetError(name, f"has shape {matrices.shape}, expected (n, 4, 4)", field=key)
    return matrices


def _from_csv(path: str) -> PoseStream:
    table = read_columns(path, _ALIASES)

    def place(i: int) -> tuple[int | None, str | None]:
        """Line and field of a row, for errors."""
        return table.lines[i], None

    if all(column in table.values for column in _QUATERNION):
        rows = table.stack(_QUATERNION)
        poses = _make_poses(rows, lambda row: SE3.from_quaternion(row[3:], row[:3]), path, place)
    elif all(column in table.values for column in _MATRIX):
        matrices = np.tile(np.eye(4), (len(table.lines), 1, 1))
        matrices[:, :3] = table.stack(_MATRIX).reshape(-1, 3, 4)
        poses = _make_poses(matrices, _matrix_pose, path, place)
    else:
        raise DatasetError(path, f"has columns {', '.join(table.values)}; {_ACCEPTED}", 1)
    return PoseStream(path, poses, table.values.get("stamp_s"))
