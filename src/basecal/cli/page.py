"""`report.html` of a run."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from basecal.cli.detected import detected_recording
from basecal.cli.terminal import say
from basecal.errors import DatasetError

if TYPE_CHECKING:
    from basecal.cell import Calibration, Cell, Recording

FILE = "report.html"


def write_page(run: Path, cell: Cell, recording: Recording, calibration: Calibration) -> Path:
    """Path of the page of a calibration that was made from this cell and recording, written into its run."""
    from basecal.accuracy.residuals.point_residuals import point_residuals
    from basecal.cell.format.writing import write_whole
    from basecal.reporting.page import page

    points = point_residuals(cell, recording, calibration)
    write_whole(run / FILE, page(cell, recording, calibration, points, title=_title(run)), within=run.parent.parent)
    return run / FILE


def rewrite_page(folder: Path, run: Path, cell: Cell, calibration: Calibration) -> Path:
    """Path of the page of a stored run.

    Where its inputs have changed since, the page says so and shows no residuals of single points.
    """
    from basecal.cell import Recording
    from basecal.cell.files import input_hashes
    from basecal.cell.format.writing import write_whole
    from basecal.reporting.page import page

    now = input_hashes(folder, cell)
    changed = [name for name, hashed in calibration.inputs.items() if now.get(name) != hashed]
    if not changed:
        return write_page(run, cell, detected_recording(folder, cell), calibration)
    note = f"{', '.join(changed)} changed since this run: names and picture are as of now. Calibrate again."
    try:
        recording = detected_recording(folder, cell)
    except DatasetError:
        recording = Recording()
    write_whole(run / FILE, page(cell, recording, calibration, title=_title(run), notes=[note]), within=folder)
    return run / FILE


def print_page_path(run: Path) -> None:
    """Print to stderr where the page of a run is; from here where the line is too long else."""
    from basecal.reporting.summary import WIDTH

    if sys.stderr is not None:
        path = str(run / FILE)
        line = f"page: {path}"
        say(line if len(line) <= WIDTH else f"page: {min(path, _from_here(path), key=len)}", sys.stderr)


def _from_here(path: str) -> str:
    """A path relative to the working folder; itself where there is none, or it is on another drive."""
    try:
        return os.path.relpath(path)
    except (OSError, ValueError):
        return path


def _title(run: Path) -> str:
    folder = os.fsencode(run.resolve().parents[1].name).decode(errors="replace")
    return f"{folder}, {run.name}"
