"""All trials of a study as one table."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from basecal.errors import InputError
from basecal.studies.chunk import COLUMNS, ChunkResult, read_chunk
from basecal.studies.columns import write_columns
from basecal.studies.study import Chunk, Study

_ROWS = 100_000  # held at a time: some tens of megabytes


def results(study: Study, folder: Path) -> Iterator[tuple[Chunk, ChunkResult]]:
    """Results of each chunk, in the study's order.

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
    return write_columns(folder, _batches(study, folder))


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


def _columns(study: Study, results: list[tuple[Chunk, ChunkResult]]) -> dict[str, Any]:
    axes = {
        name: [label for chunk, _ in results for label in [chunk.point.label[name]] * chunk.trials]
        for name in study.axes
    }
    return axes | {name: np.concatenate([getattr(result.trials, name) for _, result in results]) for name in COLUMNS}
