"""NumPy archives, without pickled objects."""

from __future__ import annotations

import zipfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.lib.npyio import NpzFile
from numpy.typing import NDArray

from basecal.errors import DatasetError
from basecal.geometry import Array


def read_arrays(path: str) -> tuple[str, dict[str, Array]]:
    """The file's name, and its arrays of numbers by key; other arrays are passed over.

    Args:
        path: `file.npy`, `file.npz`, or `file.npz:key` for one array alone.

    Raises:
        DatasetError: if it is missing, is not an archive of numbers, or has no such key.
    """
    name, key = _split(path)
    arrays = _load(name)
    if not key:
        return name, {k: value.astype(np.float64) for k, value in arrays.items() if _is_number(value)}
    if key not in arrays:
        raise DatasetError(name, f"has no array {key!r}; it holds {', '.join(arrays)}")
    if not _is_number(arrays[key]):
        raise DatasetError(name, f"holds {arrays[key].dtype}, expected numbers", field=key)
    return name, {key: arrays[key].astype(np.float64)}


def _split(path: str) -> tuple[str, str]:
    if Path(path).exists():
        return path, ""
    head, colon, key = path.rpartition(":")
    return (head, key) if colon and head.lower().endswith(".npz") else (path, "")


def _load(name: str) -> dict[str, NDArray[Any]]:
    try:
        found = np.load(name, allow_pickle=False)
        if not isinstance(found, NpzFile):
            return {"array": found}
        with found:
            return {key: found[key] for key in found.files}
    except OSError as error:
        raise DatasetError(name, f"cannot be read: {error.strerror or 'not a NumPy archive'}") from None
    except (ValueError, EOFError, zipfile.BadZipFile):
        raise DatasetError(name, "not a NumPy archive of numbers") from None


def _is_number(value: NDArray[Any]) -> bool:
    return value.dtype.kind in "iuf"
