"""Paths that stay inside a cell, and files written whole or not at all."""

from __future__ import annotations

import os
import posixpath
from collections.abc import Callable
from pathlib import Path

from basecal.errors import InputError


def inside(folder: str, relative_to: str = "") -> Callable[[str], str]:
    """A function from paths as written to paths relative to the cell.

    Args:
        folder: The cell.
        relative_to: The folder inside the cell that the paths start from.

    Returns:
        A function of a path with forward slashes. It raises InputError if the path is absolute or leaves the cell,
        also by a symbolic link.
    """
    root = os.path.realpath(folder)
    links: dict[str, frozenset[str]] = {}

    def path_in_cell(written: str) -> str:
        """A path as written, from the cell's folder."""
        path = posixpath.normpath(posixpath.join(relative_to, written))
        if not written or not written.isprintable() or "\\" in written or ":" in written[:2] or written.startswith("/"):
            raise InputError(f"{written!r} is not a relative path with forward slashes, of letters that can be shown")
        if path == ".." or path.startswith("../"):
            raise InputError(f"{written!r} leaves the cell; copy the file into it")
        parent, _, name = path.rpartition("/")
        if parent not in links:
            links[parent] = _leaving(os.path.join(root, parent), root)
        if name in links[parent] or "" in links[parent]:
            raise InputError(f"{written!r} leaves the cell by a link; copy the file into it")
        return path

    return path_in_cell


def _leaving(folder: str, root: str) -> frozenset[str]:
    """Names of a folder's links that lead out of the cell; an empty one where the folder itself does."""
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


def write_whole(path: Path, text: str) -> None:
    """Write a file so that a reader sees the old one or the new one, never a half.

    Raises:
        InputError: if it cannot be written.
    """
    part = path.with_name(f".{path.name}.part")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        part.write_text(text, encoding="utf-8")
        os.replace(part, path)
    except OSError as error:
        raise InputError(f"{path} cannot be written: {error.strerror}") from None
