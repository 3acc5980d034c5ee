"""Calibration of a fleet, locally or on a cluster; unchanged cells are not calibrated again.

In the folders of the cells, only the results of `basecal detect` are written. Rows and calibrations are written
atomically to a separate folder.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import Any

from basecal.bounded_file import read_bounded
from basecal.cell.format.writing import is_unused, make_folder, write_atomically
from basecal.errors import DatasetError, InputError
from basecal.studies.fleet.row import COLUMNS, PageMaker, calibrate_row, killed_row
from basecal.studies.jobs import Job, Progress, WorkerPool, run_jobs

ROW, CALIBRATION, PAGE, FAULT = "row.json", "calibration.json", "report.html", "fault.txt"
FLEET = "fleet.json"
SCHEMA = "basecal/fleet/1"
_CELLS = "cells"
_LARGEST_BYTES = 2**20  # of a row, which usually has some hundred bytes
_GENERATED_NAMES = frozenset({"derived", "runs"})  # generated files in the cell's folder
_CELL_NAMES = frozenset({"cell.yaml", "recording"})  # a folder with one of these names counts as a cell


@dataclass(frozen=True)
class Fleet:
    """The cells of a folder, and the folder of their results.

    Attributes:
        folder: Folder with the cells.
        cells: Paths of the cells in the folder.
        output: Folder of the rows and calibrations.
    """

    folder: Path
    cells: tuple[str, ...]
    output: Path

    def file(self, cell: str, name: str) -> Path:
        """Path of a result file of a cell."""
        return self.output / _CELLS / cell / name

    def fingerprint(self, cell: str) -> str:
        """Hash that changes with the files of a cell, and with the version of basecal."""
        return fingerprint(self.folder / cell, version("basecal"))

    def row(self, cell: str, fingerprint: str | None = None) -> Mapping[str, Any] | None:
        """The stored row of a cell; None if it is missing, or has another fingerprint than a given one."""
        try:
            row = json.loads(read_bounded(self.file(cell, ROW), _LARGEST_BYTES))
        except (DatasetError, ValueError, RecursionError):
            return None
        if not isinstance(row, dict) or (row.pop("fingerprint", None) != fingerprint and fingerprint is not None):
            return None
        return row if tuple(row) == COLUMNS else None

    def store(self, cell: str, fingerprint: str, content: bytes) -> None:
        """Store the result of `calibrate_row`; the row is written last, since it marks the result as complete.

        Raises:
            InputError: if a file cannot be written.
        """
        result = json.loads(content)
        files = {CALIBRATION: _as_text(result["calibration"]), PAGE: result["page"], FAULT: result["fault"]}
        for name, text in files.items():
            if text:
                write_atomically(self.file(cell, name), text, base_folder=self.output, durable=False)
            else:
                self.file(cell, name).unlink(missing_ok=True)
        row = result["row"] | {"fingerprint": fingerprint}
        write_atomically(self.file(cell, ROW), _as_text(row), base_folder=self.output, durable=False)


def _as_text(data: Any) -> str:
    return "" if data is None else json.dumps(data, indent=1, allow_nan=False) + "\n"


def make_fleet(folder: Path, output: Path) -> Fleet:
    """Find the cells of a folder, and create the folder of their results.

    Raises:
        InputError: if there is no cell, or the results' folder has other files or is among the cells.
    """
    cells = find_cells(folder)
    if output.resolve().is_relative_to(folder.resolve()):
        raise InputError(f"{output} is among the cells: choose a folder outside of {folder} with -o")
    make_folder(output)
    fleet_file = output / FLEET
    if not fleet_file.exists() and not is_unused(output):
        raise InputError(f"{output} holds other files and no fleet: choose another folder with -o")
    write_atomically(fleet_file, _as_text({"schema": SCHEMA, "cells": str(folder.resolve())}))
    return Fleet(folder, cells, output)


def run_fleet(
    fleet: Fleet, workers: WorkerPool, progress: Progress | None = None, make_page: PageMaker | None = None
) -> None:
    """Calibrate all new and changed cells, and store their rows in the output folder.

    Args:
        fleet: The cells.
        workers: The workers; those of a cluster need the folder of the cells under the same path.
        progress: Receives the number of finished cells and the total number.
        make_page: Creates the report page of a cell; None for no pages.

    Raises:
        InputError: if a file cannot be written, or the cluster cannot be reached.
    """
    fingerprints = {cell: fleet.fingerprint(cell) for cell in fleet.cells}
    remaining = [cell for cell, fingerprint in fingerprints.items() if fleet.row(cell, fingerprint) is None]
    folder = str(fleet.folder.resolve())
    jobs = [
        Job(k, 1, partial(calibrate_row, folder, cell, make_page), partial(killed_row, cell))
        for k, cell in enumerate(remaining)
    ]

    def store_result(job: Job, content: bytes) -> None:
        """Store the result of a cell."""
        cell = remaining[job.number]
        fleet.store(cell, fingerprints[cell], content)

    run_jobs(jobs, workers, len(fingerprints), store_result, progress)


def find_cells(folder: Path) -> tuple[str, ...]:
    """Sorted paths of the cells below a folder, at any depth; symbolic links are not followed.

    Raises:
        InputError: if there is no cell, or a folder cannot be read.
    """
    if not folder.is_dir():
        raise InputError(f"{folder} is not a folder: give the one whose cells are to be calibrated")
    found = sorted(path.relative_to(folder).as_posix() for path in _cells(folder))
    if not found:
        raise InputError(f"{folder} holds no cell: its folders, or theirs, should have a cell.yaml")
    return tuple(found)


def _cells(folder: Path) -> Iterator[Path]:
    entries = _entries(folder)
    if any(entry.name in _CELL_NAMES for entry in entries):
        yield folder
        return
    for entry in entries:
        if entry.is_dir(follow_symlinks=False) and not entry.name.startswith("."):
            yield from _cells(Path(entry.path))


def _entries(folder: Path) -> list[os.DirEntry[str]]:
    try:
        with os.scandir(folder) as entries:
            return sorted(entries, key=lambda entry: entry.name)
    except OSError as error:
        raise DatasetError(str(folder), f"cannot be read: {error.strerror}") from None


def fingerprint(cell: Path, versions: str) -> str:
    """Hash of names, sizes and times of all files of a cell except generated ones, and of a text.

    Args:
        cell: The cell's folder.
        versions: Text with the versions that the result depends on.
    """
    digest = hashlib.sha256(versions.encode())
    for name, size, changed in _files(cell, Path(), _GENERATED_NAMES):
        digest.update(f"\0{name}\0{size}\0{changed}".encode("utf-8", "surrogateescape"))
    return digest.hexdigest()


def _files(cell: Path, subfolder: Path, excluded_names: frozenset[str]) -> Iterator[tuple[str, int, int]]:
    """Path, size [bytes] and time of modification [ns] of each file."""
    for entry in _entries(cell / subfolder):
        if entry.name in excluded_names:
            continue
        if entry.is_dir(follow_symlinks=False):
            yield from _files(cell, subfolder / entry.name, frozenset())
        else:
            stat = entry.stat(follow_symlinks=False)
            yield (subfolder / entry.name).as_posix(), stat.st_size, stat.st_mtime_ns
