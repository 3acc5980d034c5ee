"""Tables as files: Parquet if pyarrow is installed, else CSV."""

from __future__ import annotations

import csv
import importlib.util
import io
import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from basecal.cell.format.writing import open_new, temporary_path, writing_errors
from basecal.geometry import Array

_NAME = "table"
_QUANTILES = {"p05": 0.05, "median": 0.5, "p95": 0.95}
Columns = Mapping[str, Any]
"""Columns of equal length by name: a list with None, or an array with NaN, for missing values."""


def quantiles(values: Sequence[float] | Array) -> dict[str, float]:
    """The 5, 50 and 95 % quantiles of values."""
    return {name: float(np.quantile(values, share)) for name, share in _QUANTILES.items()}


def write_columns(folder: Path, batches: Iterator[Columns]) -> Path:
    """Write a table into a folder; its path.

    Args:
        folder: The folder.
        batches: Consecutive rows, all with the same columns; at least one batch.

    Raises:
        InputError: if the file cannot be written.
    """
    has_parquet = importlib.util.find_spec("pyarrow") is not None
    path = folder / f"{_NAME}.{'parquet' if has_parquet else 'csv'}"
    with _temporary_file(path) as part:
        (_write_parquet if has_parquet else _write_csv)(batches, part)
    return path


@contextmanager
def _temporary_file(path: Path) -> Iterator[Path]:
    """Context of a temporary file that replaces a file at the end."""
    part = temporary_path(path)
    try:
        with writing_errors(path):
            yield part
            os.replace(part, path)
    finally:
        part.unlink(missing_ok=True)


def _write_parquet(batches: Iterator[Columns], part: Path) -> None:
    import pyarrow as pa
    import pyarrow.parquet as pq

    writer = None
    try:
        for columns in batches:
            batch = pa.table({name: _arrow(pa, values) for name, values in columns.items()})
            writer = writer or pq.ParquetWriter(part, batch.schema)
            writer.write_table(batch)
    finally:
        if writer is not None:
            writer.close()


def _arrow(pa: Any, values: Any) -> Any:
    """A column of Arrow, with nulls for NaN."""
    if isinstance(values, list):
        return pa.array(values)
    return pa.array(values, mask=np.isnan(values) if values.dtype.kind == "f" else None)


def _write_csv(batches: Iterator[Columns], part: Path) -> None:
    with open_new(part) as binary:
        text = io.TextIOWrapper(binary, encoding="utf-8", newline="")
        writer = csv.writer(text)
        for number, columns in enumerate(batches):
            if number == 0:
                writer.writerow(columns)
            writer.writerows(zip(*(_csv_values(values) for values in columns.values()), strict=True))
        text.flush()
        text.detach()


def _csv_values(values: Any) -> list[Any]:
    """Values of a column for CSV, with empty strings for NaN."""
    if isinstance(values, list):
        return values
    return ["" if value != value else value for value in values.tolist()]
