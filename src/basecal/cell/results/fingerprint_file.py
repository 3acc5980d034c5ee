"""`scene.points` beside a `calibration.json`: of each point of the scene x, y, z [m] and its descriptor, in bytes."""

from __future__ import annotations

from pathlib import Path

from basecal.bounded_file import read_bounded
from basecal.cell.fingerprint import Fingerprint
from basecal.cell.format.described_places import places_from_bytes, places_to_bytes, row_bytes
from basecal.cell.format.writing import write_atomically
from basecal.errors import DatasetError

FILE = "scene.points"
_MOST_POINTS = 100_000


def write_fingerprint(fingerprint: Fingerprint, run: Path, cell_folder: Path) -> None:
    """Write the points of a run, whose folder is within that of the cell."""
    content = places_to_bytes(fingerprint.points, fingerprint.descriptors)
    write_atomically(run / FILE, content, base_folder=cell_folder)


def read_fingerprint(run: Path) -> Fingerprint | None:
    """The points of a run; None if it has none.

    Raises:
        DatasetError: if the file cannot be read as written.
    """
    path = (run if run.is_dir() else run.parent) / FILE
    if not path.exists():
        return None
    found = places_from_bytes(read_bounded(path, _MOST_POINTS * row_bytes(3)), 3)
    if found is None:
        raise DatasetError(str(path), "damaged; calibrate again")
    return Fingerprint(*found)
