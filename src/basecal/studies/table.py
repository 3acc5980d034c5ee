"""All trials of a study as one table: Parquet where pyarrow is installed, else CSV."""

from __future__ import annotations

import csv
import importlib.util
import io
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from basecal.cell.format.writing import beside, open_new
from basecal.errors import InputError
from basecal.studies.chunk import COLUMNS, ChunkResult, read_chunk
from basecal.studies.study import Chunk, Study

_NAME = "table"
_ROWS = 100_000  # held at a time: some tens of megabytes


def results(study: Study, folder: Path) -> Iterator[tuple[Chunk, ChunkResult]]:
    """What came of each chunk, in the study's order.

    Raises:
        InputError: if one is missing.
    """
    for chunk in study.chunks:
        result = read_chunk(folder, study, chunk)
        if result is None:
            raise InputError(f"{folder} lacks the trials of chunk {chunk.index}: run the study again to complete it")
        yield chunk, result


def write_table(study: Study, folder: Path) -> Path:
    """Path of the table written into the study's folder: a row for each trial, the axes' values first.

    Raises:
        InputError: if it cannot be written.
    """
    parquet = importlib.util.find_spec("pyarrow") is not None
    path = folder / f"{_NAME}.{'parquet' if parquet else 'csv'}"
    with _appearing(path) as part:
        (_write_parquet if parquet else _write_csv)(study, folder, part)
    return path


@contextmanager
def _appearing(path: Path) -> Iterator[Path]:
    """A name to write to, which is the file's at the end."""
    part = beside(path)
    try:
        yield part
        os.replace(part, path)
    except OSError as error:
        raise InputError(f"{path} cannot be written: {error.strerror}") from None
    finally:
        part.unlink(missing_ok=True)


def _batches(study: Study, folder: Path) -> Iterator[dict[str, Any]]:
    """Columns of consecutive trials, each batch of some thousands."""
    held: list[tuple[Chunk, ChunkResult]] = []
    for each in results(study, folder):
        held.append(each)
        if sum(chunk.trials for chunk, _ in held) >= _ROWS:
            yield _columns(study, held)
            held = []
    if held:
        yield _columns(study, held)


def _columns(study: Study, held: list[tuple[Chunk, ChunkResult]]) -> dict[str, Any]:
    axes = {
        name: [label for chunk, _ in held for label in [chunk.point.label[name]] * chunk.trials] for name in study.axes
    }
    return axes | {name: np.concatenate([getattr(result.trials, name) for _, result in held]) for name in COLUMNS}


def _write_parquet(study: Study, folder: Path, part: Path) -> None:
    import pyarrow as pa
    import pyarrow.parquet as pq

    writer = None
    try:
        for columns in _batches(study, folder):
            arrays = {name: _arrow(pa, values) for name, values in columns.items()}
            batch = pa.table(arrays)
            writer = writer or pq.ParquetWriter(part, batch.schema)
            writer.write_table(batch)
    finally:
        if writer is not None:
            writer.close()


def _arrow(pa: Any, values: Any) -> Any:
    """A column of Arrow, missing where there is no number."""
    if isinstance(values, list):
        return pa.array(values)
    return pa.array(values, mask=np.isnan(values) if values.dtype.kind == "f" else None)


def _write_csv(study: Study, folder: Path, part: Path) -> None:
    with open_new(part) as binary:
        text = io.TextIOWrapper(binary, encoding="utf-8", newline="")
        writer = csv.writer(text)
        writer.writerow([*study.axes, *COLUMNS])
        for columns in _batches(study, folder):
            writer.writerows(zip(*(_plain(values) for values in columns.values()), strict=True))
        text.flush()
        text.detach()


def _plain(values: Any) -> list[Any]:
    """A column's values, nothing where there is no number."""
    if isinstance(values, list):
        return values
    return ["" if value != value else value for value in values.tolist()]
