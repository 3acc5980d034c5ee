"""Detected points as other programs write them: one row a point, in CSV or NumPy archives."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from basecal.errors import DatasetError
from basecal.exchange.columns import read_columns
from basecal.exchange.npz import read_arrays
from basecal.geometry import Array, IntArray

_ALIASES = {"sample": ("samples",), "id": ("ids",), "u": ("u_px",), "v": ("v_px",)}
_EXPECTED = "expected sample, id, u, v (one row a point; in an archive also pixels, (n, 2), for u and v)"


def read_pixels(path: str | Path) -> dict[int, tuple[IntArray, Array]]:
    """Ids (n,) and pixels (n, 2) [px] by sample, counted from 0, in the order of the ids.

    Args:
        path: A `.csv` with the columns sample, id, u, v, or a `.npz` with arrays of those names.

    Raises:
        DatasetError: if it holds anything else, or one id of a sample twice.
    """
    name = str(path)
    columns = _from_archive(name) if ".npz" in name.lower() else read_columns(name, _ALIASES).values
    missing = [key for key in ("sample", "id", "u", "v") if key not in columns]
    if missing:
        raise DatasetError(name, f"has no {', '.join(missing)} but {', '.join(columns) or 'nothing'}; {_EXPECTED}")
    samples, ids = _whole_numbers(name, columns, "sample"), _whole_numbers(name, columns, "id")
    pixels = np.stack([columns["u"], columns["v"]], -1)
    views = {}
    for sample in np.unique(samples).tolist():
        rows = np.flatnonzero(samples == sample)
        rows = rows[np.argsort(ids[rows], kind="stable")]
        twice = ids[rows][1:][np.diff(ids[rows]) == 0]
        if len(twice):
            raise DatasetError(name, f"sample {sample} has id {twice[0]} twice")
        views[sample] = ids[rows], pixels[rows]
    return views


def _whole_numbers(path: str, columns: Mapping[str, Array], key: str) -> IntArray:
    whole = np.round(columns[key]).astype(np.int64)
    wrong = np.flatnonzero((columns[key] != whole) | (whole < 0))
    if len(wrong):
        raise DatasetError(
            path, f"row {wrong[0]} is {columns[key][wrong[0]]:g}, expected a whole number from 0", field=key
        )
    return whole


def _from_archive(path: str) -> dict[str, Array]:
    known = {alias: name for name, others in _ALIASES.items() for alias in (name, *others)}
    name, arrays = read_arrays(path)
    columns = {known.get(key, key): value for key, value in arrays.items()}
    if "pixels" in columns:
        pixels = columns.pop("pixels")
        if pixels.ndim != 2 or pixels.shape[1] != 2:
            raise DatasetError(name, f"has shape {pixels.shape}, expected (n, 2)", field="pixels")
        columns["u"], columns["v"] = pixels.T
    for key, value in columns.items():
        if value.ndim != 1 or len(value) != len(next(iter(columns.values()))):
            raise DatasetError(name, f"has shape {value.shape}, expected one number for every point", field=key)
        if not np.isfinite(value).all():
            raise DatasetError(name, f"row {np.flatnonzero(~np.isfinite(value))[0]} is not finite", field=key)
    return columns
