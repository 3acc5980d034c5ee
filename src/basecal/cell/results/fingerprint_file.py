"""`scene.points` next to a `calibration.json`: binary positions [m] and descriptors of the scene points."""

from __future__ import annotations

from pathlib import Path

from basecal.bounded_file import read_bounded
from basecal.cell.fingerprint import Fingerprint
from basecal.cell.format.described_places import points_from_bytes, points_to_bytes, row_bytes
from basecal.cell.format.writing import write_atomically
from basecal.errors import DatasetError

FILE = "scene.points"
_MOST_POINTS = 100_000


def write_fingerprint(fingerprint: Fingerprint, run: Path, cell_folder: Path) -> None:
    """Write the scene points of a run; the run's folder is inside the cell's folder."""
    content = points_to_bytes(fingerprint.points, fingerprint.descriptors)
    write_atomically(run / FILE, content, base_folder=cell_folder)


def read_fingerprint(run: Path) -> Fingerprint | None:
    """Read the scene points of a run; None if it has none.

    Raises:
        DatasetError: if the file cannot be read or is damaged.
    """
    path = (run if run.is_dir() else run.parent) / FILE
    if not path.exists():
        return None
    arrays = points_from_bytes(read_bounded(path, _MOST_POINTS * row_bytes(3)), 3)
    if arrays is None:
        raise DatasetError(str(path), "damaged; calibrate again")
    return Fingerprint(*arrays)
