"""Content of a cell's folder before an import."""

from __future__ import annotations

from pathlib import Path

from basecal.cell import Cell, Sample
from basecal.cell.files import read_cell, read_recording


def known_cell(folder: str | Path) -> Cell | None:
    """The cell of a folder; None if there is none yet.

    Raises:
        DatasetError: if it cannot be read.
    """
    return read_cell(folder) if (Path(folder) / "cell.yaml").exists() else None


def recorded_samples(folder: str | Path, cell: Cell) -> tuple[Sample, ...]:
    """The samples that are recorded in the folder of a cell.

    Raises:
        DatasetError: if they cannot be read.
    """
    if not (Path(folder) / "recording" / "samples.jsonl").exists():
        return ()
    return read_recording(folder, cell).samples
