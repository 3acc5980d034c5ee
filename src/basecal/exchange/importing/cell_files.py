"""Placing of files in a cell, with removal if the import fails."""

from __future__ import annotations

import filecmp
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path, PurePosixPath
from tempfile import TemporaryDirectory

from basecal.bounded_file import read_bounded
from basecal.cell.format.paths import path_resolver
from basecal.cell.format.writing import make_folder, write_atomically
from basecal.errors import InputError
from basecal.exchange.images import check_image, is_image

_LARGEST_BYTES = 2**28  # 256 MiB, the limit of images


@contextmanager
def place_files(files: Mapping[str, Path], folder: Path, link: bool = False) -> Iterator[None]:
    """Place files in a cell for the context; they are removed if the context fails.

    An existing file with the same content is not changed.

    Args:
        files: Source files by their path in the cell.
        folder: The cell's folder.
        link: Whether to make hard links instead of copies.

    Raises:
        DatasetError: if a source is not a regular file, is too large, or has an image's name but is not an image.
        InputError: if a different file exists, a path leaves the cell, or a file cannot be written.
    """
    created: list[Path] = []
    is_new = not folder.exists()
    try:
        path_in_cell = path_resolver(str(folder))
        for name, source in files.items():
            target = folder / path_in_cell(name)
            if is_image(target):
                check_image(source)
            if not os.path.lexists(target):
                make_folder(target.parent, folder)
                created.append(target)
                _place_file(source, target, link)
            elif not target.is_file() or not filecmp.cmp(source, target, shallow=False):
                raise InputError(f"{target} exists and differs from {source}: it is not overwritten")
        yield
    except OSError as error:
        _remove_files(created, folder, is_new)
        raise InputError(f"{error.filename or folder} cannot be written: {error.strerror}") from None
    except BaseException:
        _remove_files(created, folder, is_new)
        raise


@contextmanager
def scratch_folder(cell: str | Path) -> Iterator[TemporaryDirectory[str]]:
    """Create a temporary folder on the disk of a cell; it is removed if the context fails."""
    existing_parent = next(parent for parent in Path(cell).absolute().parents if parent.exists())
    scratch = TemporaryDirectory(prefix=".import-", dir=existing_parent)
    try:
        yield scratch
    except BaseException:
        scratch.cleanup()
        raise


def numbered_path(path: str, number: int) -> str:
    """Path of an image with the number of its sample as prefix of its name."""
    original = PurePosixPath(path)
    return str(original.with_name(f"{number:06d}_{original.name}"))


def _place_file(source: Path, target: Path, link: bool) -> None:
    if link:
        try:
            os.link(source.resolve(), target)  # not the link that a source may be
        except OSError as error:
            why = f"{source} cannot be linked into {target.parent} ({error.strerror})"
            raise InputError(f"{why}: hard links need one disk; omit --link to copy") from None
        return
    write_atomically(target, read_bounded(source, _LARGEST_BYTES), durable=False)


def _remove_files(files: list[Path], folder: Path, is_new: bool) -> None:
    """Remove created files and the folders left empty; the cell's folder only if it is new."""
    for path in files:
        with suppress(OSError):
            path.unlink(missing_ok=True)
    parents = {parent for path in files for parent in path.parents if parent.is_relative_to(folder)}
    for parent in sorted(parents, key=lambda path: len(path.parts), reverse=True):
        if parent != folder or is_new:
            with suppress(OSError):
                parent.rmdir()
