"""Units of length, and reading of poses as 4x4 matrices in text or NumPy archives."""

from __future__ import annotations

from array import array
from collections.abc import Sequence
from io import StringIO
from typing import Literal

import numpy as np

from basecal.cell.journal.recording_file import MOST_SAMPLES
from basecal.errors import DatasetError, InputError, count_text, list_names
from basecal.exchange.columns import read_table_text
from basecal.exchange.fields import parse_float
from basecal.exchange.npz import read_arrays
from basecal.fields.problems import shorten
from basecal.fields.values import LARGEST_VALUE
from basecal.geometry import SE3, Array

LengthUnit = Literal["m", "mm", "inch"]
METRES: dict[LengthUnit, float] = {"m": 1.0, "mm": 1e-3, "inch": 0.0254}
"""Size of each unit of length [m]."""


def unit_length_m(unit: str) -> float:
    """Size of a unit of length [m].

    Raises:
        InputError: if there is no such unit.
    """
    known = {str(name): size for name, size in METRES.items()}
    if unit not in known:
        raise InputError(f"length unit {unit!r}: expected one of {list_names(list(known))}")
    return known[unit]


def read_matrices(path: str) -> SE3:
    """Read poses from 4x4 matrices, (n,), with lengths in the unit of the file.

    Args:
        path: Text with matrices below each other, or a NumPy archive, as `file.npz:key` if it has several arrays.

    Raises:
        DatasetError: with file and line, if the content is invalid or a matrix is not a rigid transform.
    """
    matrices, lines = (_from_archive(path), None) if is_archive(path) else _from_text(path)
    if len(matrices) > MOST_SAMPLES:
        raise DatasetError(path, f"{len(matrices)} poses, expected at most {MOST_SAMPLES}")
    found = []
    for i, matrix in enumerate(matrices):
        location = (None, f"matrix {i}") if lines is None else (lines[4 * i], None)
        try:
            found.append(SE3.from_matrix(matrix, "pose"))
        except InputError as error:
            raise DatasetError(path, str(error), *location) from None
        if not np.all(np.abs(found[-1].translation) <= LARGEST_VALUE):
            raise DatasetError(path, f"a translation is beyond {LARGEST_VALUE:g}: is this the length unit?", *location)
    return SE3.stack(found)


def is_archive(path: str) -> bool:
    """Whether a path has the name of a NumPy file."""
    return ".npz" in path.lower() or path.lower().endswith(".npy")


def _from_text(path: str) -> tuple[Array, Sequence[int]]:
    content = read_table_text(path, "rows of 4 numbers, or a name that ends in .csv or .npz")
    # Arrays of bytes, because lists of lists need forty times the memory.
    values, lines = array("d"), array("q")
    for number, text in enumerate(StringIO(content), start=1):
        words = text.split("#")[0].replace(",", " ").split()
        if not words:
            continue
        if len(words) != 4:
            raise DatasetError(
                path,
                f"{count_text(len(words), 'number')}, expected rows of 4: 4x4 matrices one below the other",
                number,
            )
        try:
            values.extend([parse_float(word) for word in words])
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
            name, f"holds {', '.join(arrays) or 'nothing'}; choose one as {name}:{next(iter(arrays), 'key')}"
        )
    ((key, matrices),) = arrays.items()
    if matrices.ndim != 3 or matrices.shape[1:] != (4, 4) or not len(matrices):
        raise DatasetError(name, f"has shape {matrices.shape}, expected (n, 4, 4)", field=key)
    return matrices
