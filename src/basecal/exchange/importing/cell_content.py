"""Content of a cell's folder before an import."""

from __future__ import annotations

from pathlib import Path

from basecal.cell import Cell, Sample
from basecal.cell.files import read_cell, read_recording
from basecal.fields.problems import Loc


def known_cell(folder: str | Path) -> Cell | None:
    """The cell of a folder; None if there is none yet.

    Raises:
        DatasetError: if it cannot be read.
    """
    return read_cell(folder) if (Path(folder) / "cell.yaml").exists() else None


def recorded_samples(folder: str | Path, cell: Cell | None) -> tuple[Sample, ...]:
    """The samples that are recorded in the folder of a cell; none if there is no cell.

    Raises:
        DatasetError: if they cannot be read.
    """
    if cell is None or not (Path(folder) / "recording" / "samples.jsonl").exists():
        return ()
    return read_recording(folder, cell).samples


def open_size(folder: str | Path, cell: Cell, camera: str) -> frozenset[Loc]:
    """The place of a known camera's size, if nothing rests on it: its first images may state another."""
    known = cell.cameras[camera]
    has_numbers = known.intrinsics is not None and known.intrinsics.camera is not None
    samples = recorded_samples(folder, cell)
    is_recorded = any(camera in s.images or any(o.camera == camera for o in s.observations) for s in samples)
    return frozenset() if has_numbers or is_recorded else frozenset({("cameras", camera, "size_px")})
