"""Backup copies of a cell's files before a change."""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterable, Mapping
from pathlib import Path

from basecal.cell.format.writing import make_timed_folder, write_atomically

ORIGINALS = "originals"
"""Folder of a cell with one backup folder per change, named by its time."""


def keep_originals(folder: Path, paths: Iterable[Path], note: Mapping[str, str]) -> Path:
    """Copy files to a new backup folder with a note about the change, and return the folder.

    Args:
        folder: The cell's folder.
        paths: Files in the cell; missing files are skipped.
        note: Description of the change for `change.json`.
    """
    backup = make_timed_folder(folder / ORIGINALS, folder)
    for path in paths:
        if path.exists():
            shutil.copy2(path, backup / path.name)
    write_atomically(backup / "change.json", json.dumps(dict(note), indent=1) + "\n", base_folder=folder)
    return backup
