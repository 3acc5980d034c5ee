"""Files of a cell as they were before something changed them."""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterable, Mapping
from pathlib import Path

from basecal.cell.format.writing import make_timed_folder, write_atomically

ORIGINALS = "originals"
"""Folder of a cell with a folder for each change, by its time."""


def keep_originals(folder: Path, paths: Iterable[Path], note: Mapping[str, str]) -> Path:
    """The folder that holds copies of those files that exist, and a note of what is done to them.

    Args:
        folder: The cell's.
        paths: Files in it.
        note: What is done, for `change.json`.
    """
    kept = make_timed_folder(folder / ORIGINALS, folder)
    for path in paths:
        if path.exists():
            shutil.copy2(path, kept / path.name)
    write_atomically(kept / "change.json", json.dumps(dict(note), indent=1) + "\n", base_folder=folder)
    return kept
