"""Reading of NumPy archives, without pickled objects."""

from __future__ import annotations

import math
import zipfile
import zlib
from io import BytesIO
from pathlib import Path
from tokenize import TokenError
from typing import IO

import numpy as np
from numpy.lib import format as npy

from basecal.bounded_file import read_bounded
from basecal.errors import DatasetError, list_names
from basecal.fields.problems import CAUSE_LENGTH, shorten
from basecal.geometry import Array

LARGEST_BYTES = 2**27
"""Largest size of unpacked arrays [bytes]: 128 MB, sixteen million numbers."""

_LARGEST_FILE = 2**28  # [bytes]
_MOST_ARRAYS = 1000  # in an archive: each takes memory before it is read
_HEADER_ERRORS = (ValueError, EOFError, SyntaxError, TypeError, OverflowError, MemoryError, RecursionError, TokenError)
_ENTRY, _ZIP, _NPY = b"PK\x01\x02", b"PK", b"\x93NUMPY"


def read_arrays(path: str) -> tuple[str, dict[str, Array]]:
    """Read the file's name, and its numeric arrays by key; other arrays are skipped.

    Only requested arrays are unpacked, up to a size limit.

    Args:
        path: `file.npy`, `file.npz`, or `file.npz:key` for a single array.

    Raises:
        DatasetError: if the file is missing, is not an archive of numbers, is too large, or has no such key.
    """
    name, key = path, ""
    if not Path(path).exists():
        archive_name, colon, last = path.rpartition(":")
        if colon and archive_name.lower().endswith(".npz"):
            name, key = archive_name, last
    data = read_bounded(name, _LARGEST_FILE)
    if data.startswith(_NPY):
        return name, {"array": _numbers(name, "array", BytesIO(data), len(data))}
    if not data.startswith(_ZIP) or data.count(_ENTRY) > _MOST_ARRAYS:
        raise DatasetError(name, "not a NumPy archive of numbers")
    try:
        with zipfile.ZipFile(BytesIO(data)) as archive:
            return name, _unpack(name, key, archive)
    except DatasetError:
        raise
    except (ValueError, EOFError, RuntimeError, OSError, zipfile.BadZipFile, zlib.error) as error:
        raise DatasetError(name, f"not a NumPy archive of numbers ({str(error)[:CAUSE_LENGTH]})") from None


def _unpack(name: str, key: str, archive: zipfile.ZipFile) -> dict[str, Array]:
    entries = {entry.filename.removesuffix(".npy"): entry for entry in archive.infolist()}
    if key and key not in entries:
        raise DatasetError(name, f"has no array {key!r}; it holds {list_names(list(entries))}")
    if sum(entry.file_size for array_key, entry in entries.items() if key in ("", array_key)) > LARGEST_BYTES:
        raise DatasetError(name, f"unpacks to more than {LARGEST_BYTES / 2**20:.0f} MB; choose one as {name}:key")
    found = {}
    for array_key, entry in entries.items():
        if key not in ("", array_key):
            continue
        with archive.open(entry) as file:
            try:
                found[array_key] = _numbers(name, array_key, file, entry.file_size)
            except _NotNumbers:
                if key:
                    raise
    return found


class _NotNumbers(DatasetError):
    """Error about a non-numeric array."""


def _numbers(name: str, key: str, file: IO[bytes], size: int) -> Array:
    """Read the array in a file of `size` bytes; the header may not promise more data than that."""
    try:
        version = npy.read_magic(file)
        read_header = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
        shape, by_columns, dtype = read_header(file)
    except _HEADER_ERRORS as error:
        raise DatasetError(name, f"not a NumPy archive of numbers ({str(error)[:CAUSE_LENGTH]})", field=key) from None
    if dtype.kind not in "iuf":
        kind = DatasetError if dtype.hasobject else _NotNumbers
        raise kind(name, f"not a NumPy archive of numbers: holds {shorten(str(dtype))}, expected numbers", field=key)
    count = math.prod(shape)
    if min(shape, default=0) < 0 or not count * dtype.itemsize <= min(size, LARGEST_BYTES):
        raise DatasetError(name, f"a header of shape {shorten(list(shape))} does not match {size} bytes", field=key)
    content = file.read(count * dtype.itemsize)
    if len(content) != count * dtype.itemsize:
        raise DatasetError(name, "is cut off", field=key)
    data = np.frombuffer(content, dtype=dtype)
    return data.reshape(shape, order="F" if by_columns else "C").astype(np.float64)
