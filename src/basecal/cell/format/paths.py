"""Paths that stay inside a cell."""

from __future__ import annotations

import os
import posixpath
from collections.abc import Callable
from pathlib import Path

from basecal.errors import DatasetError, InputError

_LONGEST_NAME = 255  # [bytes] of a file or a folder, on all usual file systems
_LONGEST_PATH = 1000  # characters: with the cell's own path far below 4096 bytes, the usual system limit
_SHOWN_LENGTH = 40  # characters of a name that is too long


def path_resolver(folder: str, relative_to: str = "") -> Callable[[str], str]:
    """Create a function that converts paths as written to paths relative to the cell.

    Args:
        folder: The cell's folder.
        relative_to: Folder inside the cell to which the written paths are relative.

    Returns:
        Function of a path with forward slashes. It raises InputError if the path is absolute or leaves the cell,
        also through a symbolic link.
    """
    root = os.path.realpath(folder)
    links: dict[str, frozenset[str]] = {}

    def path_in_cell(text: str) -> str:
        """Return a written path relative to the cell's folder."""
        if any(len(part.encode("utf-8", "surrogatepass")) > _LONGEST_NAME for part in text.split("/")):
            raise InputError(f"{text[:_SHOWN_LENGTH]!r}... is longer than a file's name may be, {_LONGEST_NAME} bytes")
        if len(text) > _LONGEST_PATH:
            raise InputError(f"{text[:_SHOWN_LENGTH]!r}... has more than {_LONGEST_PATH} characters; move the file up")
        path = posixpath.normpath(posixpath.join(relative_to, text))
        if not text or not text.isprintable() or "\\" in text or ":" in text[:2] or text.startswith("/"):
            raise InputError(f"{text!r} is not a relative path with forward slashes and printable characters")
        if path == ".." or path.startswith("../"):
            raise InputError(f"{text!r} leaves the cell; copy the file into it")
        parent, _, name = path.rpartition("/")
        if parent not in links:
            links[parent] = _outward_links(os.path.join(root, parent), root)
        if name in links[parent] or "" in links[parent]:
            raise InputError(f"{text!r} leaves the cell by a link; copy the file into it")
        return path

    return path_in_cell


def _outward_links(folder: str, root: str) -> frozenset[str]:
    """Names of a folder's links that lead out of the cell; one empty name if the folder itself is outside."""
    if not _is_within(folder, root):
        return frozenset({""})
    try:
        with os.scandir(folder) as entries:
            links = [entry.name for entry in entries if entry.is_symlink()]
    except OSError:
        return frozenset()
    return frozenset(name for name in links if not _is_within(os.path.join(folder, name), root))


def _is_within(path: str, root: str) -> bool:
    try:
        return Path(os.path.realpath(path)).is_relative_to(root)
    except (OSError, ValueError):
        return False


def own_file(folder: str | Path, name: str) -> Path:
    """Path of a cell's standard file, such as `cell.yaml`.

    Raises:
        DatasetError: if the folder is a file, or the path is a link that leads out of the cell.
    """
    path = Path(folder) / name
    if os.path.isfile(folder):
        raise DatasetError(str(folder), f"is a file: give the folder of the cell, which holds {name}")
    if not _is_within(os.fspath(path), os.path.realpath(folder)):
        raise DatasetError(str(path), "is a link that leads out of the cell; copy the file into it")
    return path
