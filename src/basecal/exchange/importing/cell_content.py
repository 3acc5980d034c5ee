"""Content of a cell's folder before an import."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from basecal.cell import Cell, CellCamera, CellTarget, Robot, Sample
from basecal.cell.files import read_cell, read_recording
from basecal.fields.problems import Loc


@dataclass(frozen=True)
class NoCell:
    """The content of a folder without a `cell.yaml`: nothing."""

    robots: Mapping[str, Robot] = field(default_factory=dict)
    cameras: Mapping[str, CellCamera] = field(default_factory=dict)
    targets: Mapping[str, CellTarget] = field(default_factory=dict)


KnownCell = Cell | NoCell
NO_CELL = NoCell()


def known_cell(folder: str | Path) -> KnownCell:
    """The cell of a folder, or that there is none yet.

    Raises:
        DatasetError: if it cannot be read.
    """
    return read_cell(folder) if (Path(folder) / "cell.yaml").exists() else NO_CELL


def recorded_samples(folder: str | Path, cell: KnownCell) -> tuple[Sample, ...]:
    """The samples that are recorded in the folder of a cell; none if there is no cell.

    Raises:
        DatasetError: if they cannot be read.
    """
    if isinstance(cell, NoCell) or not (Path(folder) / "recording" / "samples.jsonl").exists():
        return ()
    return read_recording(folder, cell).samples


def open_size(folder: str | Path, cell: KnownCell, camera: str) -> frozenset[Loc]:
    """The place of a known camera's size, if nothing rests on it: its first images may state another."""
    known = cell.cameras[camera]
    has_numbers = known.intrinsics is not None and known.intrinsics.camera is not None
    samples = recorded_samples(folder, cell)
    is_recorded = any(camera in s.images or any(o.camera == camera for o in s.observations) for s in samples)
    return frozenset() if has_numbers or is_recorded else frozenset({("cameras", camera, "size_px")})
