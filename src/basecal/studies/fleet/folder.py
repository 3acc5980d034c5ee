"""The cells in a folder, and what shows whether one has changed."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterator
from pathlib import Path

from basecal.errors import DatasetError, InputError

_MADE = frozenset({"derived", "runs"})  # what programs make of a cell, in its own folder
_MARKS = frozenset({"cell.yaml", "recording"})  # a folder that has one of them is meant to be a cell


def find_cells(folder: Path) -> tuple[str, ...]:
    """Paths of the cells below a folder, at any depth, in their order; links are not followed.

    Raises:
        InputError: if there is none, or the folder cannot be read.
    """
    if not folder.is_dir():
        raise InputError(f"{folder} is no folder: give the one whose cells are to be calibrated")
    found = sorted(path.relative_to(folder).as_posix() for path in _cells(folder))
    if not found:
        raise InputError(f"{folder} holds no cell: its folders, or theirs, should have a cell.yaml")
    return tuple(found)


def _cells(folder: Path) -> Iterator[Path]:
    entries = _entries(folder)
    if any(entry.name in _MARKS for entry in entries):
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
    """A hash of names, sizes and times of all files of a cell but those made of it, and of a text.

    Args:
        cell: The cell's folder.
        versions: What else the answer depends on.
    """
    digest = hashlib.sha256(versions.encode())
    for name, size, changed in _files(cell, Path(), _MADE):
        digest.update(f"\0{name}\0{size}\0{changed}".encode("utf-8", "surrogateescape"))
    return digest.hexdigest()


def _files(cell: Path, subfolder: Path, left_out: frozenset[str]) -> Iterator[tuple[str, int, int]]:
    """Path, size and time of change [ns] of each file."""
    for entry in _entries(cell / subfolder):
        if entry.name in left_out:
            continue
        if entry.is_dir(follow_symlinks=False):
            yield from _files(cell, subfolder / entry.name, frozenset())
        else:
            stat = entry.stat(follow_symlinks=False)
            yield (subfolder / entry.name).as_posix(), stat.st_size, stat.st_mtime_ns
