"""`scene.points` beside a `calibration.json`: of each point of the scene x, y, z [m] and its descriptor, in bytes."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from basecal.bounded_file import read_bounded
from basecal.cell.fingerprint import Fingerprint
from basecal.cell.format.writing import write_atomically
from basecal.errors import DatasetError

FILE = "scene.points"
_DESCRIPTOR = 128
_POINT_BYTES = 24
_ROW_BYTES = _POINT_BYTES + _DESCRIPTOR
_MOST_POINTS = 100_000


def write_fingerprint(fingerprint: Fingerprint, run: Path, cell_folder: Path) -> None:
    """Write the points of a run, whose folder is within that of the cell."""
    content = fingerprint.points.astype("<f8").tobytes() + fingerprint.descriptors.tobytes()
    write_atomically(run / FILE, content, base_folder=cell_folder)


def read_fingerprint(run: Path) -> Fingerprint | None:
    """The points of a run; None if it has none.

    Raises:
        DatasetError: if the file cannot be read as written.
    """
    path = (run if run.is_dir() else run.parent) / FILE
    if not path.exists():
        return None
    data = read_bounded(path, _MOST_POINTS * _ROW_BYTES)
    count, rest = divmod(len(data), _ROW_BYTES)
    points = np.frombuffer(data, dtype="<f8", count=3 * count).reshape(count, 3).astype(np.float64)
    if rest or not np.isfinite(points).all():
        raise DatasetError(str(path), "damaged; calibrate again")
    levels = np.frombuffer(data, dtype=np.uint8, offset=_POINT_BYTES * count).reshape(count, _DESCRIPTOR)
    return Fingerprint(points, levels)
