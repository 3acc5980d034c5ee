"""`report.html` of a run."""

from __future__ import annotations

import os
import sys
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

from basecal.cli.detect import detected_recording
from basecal.cli.terminal import quote_path, say
from basecal.errors import DatasetError, InputError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from basecal.accuracy.fit_details import FitDetails
    from basecal.cell import Calibration, Cell, Recording
    from basecal.cell.fingerprint import Fingerprint

FILE = "report.html"
_STAMP, _STAMP_LENGTH = "%Y%m%dT%H%M%SZ", 16  # of the names of runs, which may have a number appended


@dataclass(frozen=True, eq=False)
class StoredRun:
    """A run with its current recording.

    Attributes:
        run: Folder of the run.
        recording: The current recording; empty if it can no longer be read.
        shown: Cell and recording, with the points of the scene as a target if the run stored any.
        details: Details of the fit; empty if the inputs have changed since the run.
        changed: Names of the changed inputs.
    """

    run: Path
    recording: Recording
    shown: tuple[Cell, Recording]
    details: FitDetails
    changed: tuple[str, ...] = ()


def stored_run(folder: Path, run: Path, cell: Cell, calibration: Calibration) -> StoredRun:
    """Read the recording of a run and recompute the details of its fit."""
    from basecal.accuracy.fit_details import FitDetails, fit_details
    from basecal.cell import Recording
    from basecal.cell.files import input_hashes
    from basecal.cell.results.fingerprint_file import read_fingerprint
    from basecal.estimation.streams.streams import synchronous_recording

    hashes = input_hashes(folder, cell)
    changed = tuple(name for name, stored_hash in calibration.inputs.items() if hashes.get(name) != stored_hash)
    if not changed:
        recording = synchronous_recording(cell, detected_recording(folder, cell), calibration)
        shown = add_stored_scene(cell, recording, calibration, read_fingerprint(run))
        return StoredRun(run, recording, shown, fit_details(*shown, calibration))
    try:
        recording = detected_recording(folder, cell)
    except DatasetError:
        recording = Recording()
    return StoredRun(run, recording, (cell, recording), FitDetails(), changed)


def add_stored_scene(
    cell: Cell, recording: Recording, calibration: Calibration, fingerprint: Fingerprint | None
) -> tuple[Cell, Recording]:
    """Cell and recording with the points of the scene as a target; unchanged if the calibration stored none."""
    if fingerprint is None:
        return cell, recording
    from basecal.accuracy.scene.fingerprint import with_scene_as_target

    return with_scene_as_target(cell, calibration, recording, fingerprint)


def write_page(cell: Cell, calibration: Calibration, run: StoredRun) -> Path:
    """Write the page of a run, with a note if inputs have changed since, and return its path."""
    from basecal.cell.files import read_verifications
    from basecal.cell.format.writing import write_atomically
    from basecal.reporting.page import page

    names = ", ".join(run.changed)
    notes = [f"{names} changed since this run: names and image are as of now. Calibrate again."] if names else []
    path, cell_name = run.run / FILE, run.run.resolve().parents[1].name
    html = page(
        *run.shown,
        calibration,
        run.details,
        title=os.fsencode(cell_name).decode(errors="replace"),
        time=_run_time(run.run),
        run=run.run.name,
        notes=notes,
        outlook=() if run.changed else _outlook(cell, run.recording, calibration),
        verifications=[each for each in read_verifications(run.run.parent.parent) if each.run == run.run.name],
    )
    write_atomically(path, html, base_folder=run.run.parent.parent)
    return path


def _outlook(cell: Cell, recording: Recording, calibration: Calibration) -> Sequence[tuple[int, float]]:
    """The expected gain of more samples; empty without a task and a tolerance, or if none can be planned."""
    if not calibration.budget and calibration.tolerance is None:
        return ()
    from basecal.accuracy.task.task import task_places
    from basecal.errors import BasecalError
    from basecal.planning.plan import outlook

    points_m = task_places(calibration.settings.get("task_point"), calibration.settings.get("task_box"))
    try:
        return outlook(cell, recording, calibration, points_m)
    except BasecalError:  # such as a transform that was not found: the page says so elsewhere
        return ()


def show_page(file: Path, opens: bool) -> None:
    """Print the path of a page to stderr, as relative path if the line is too long; open the page if requested."""
    from basecal.reporting.summary import LINE_WIDTH

    if sys.stderr is not None:
        path = str(file)
        try:
            relative_path = os.path.relpath(path)
        except (OSError, ValueError):  # there is no working folder, or it is on another drive
            relative_path = path
        line = f"page: {path}"
        say(line if len(line) <= LINE_WIDTH else f"page: {min(path, relative_path, key=len)}", sys.stderr)
    if opens:
        import webbrowser

        webbrowser.open(file.resolve().as_uri())


def _run_time(run: Path) -> datetime | None:
    """Time of a run, UTC, from the name of its folder; None if the name is another."""
    try:
        return datetime.strptime(run.name[:_STAMP_LENGTH], _STAMP).replace(tzinfo=UTC)
    except ValueError:
        return None


def find_run(path: Path) -> Path:
    """The latest run of a cell's folder; any other path is returned as the path of a run.

    Raises:
        InputError: if the cell has no run.
    """
    from basecal.cell.files import latest_run

    if not (path / "cell.yaml").is_file():
        return path
    run = latest_run(path)
    if run is None:
        raise InputError(f"{path} has no run yet: basecal calibrate {quote_path(path)}")
    return run
