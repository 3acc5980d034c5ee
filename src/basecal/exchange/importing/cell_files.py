"""Files put into a cell, and taken out again where what they were for fails."""

from __future__ import annotations

import filecmp
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path, PurePosixPath
from tempfile import TemporaryDirectory

from basecal.bounded_file import read_bounded
from basecal.cell.format.paths import inside
from basecal.cell.format.writing import make_folder, write_atomically
from basecal.errors import InputError
from basecal.exchange.images import check_image, is_image

_LARGEST_BYTES = 2**28  # 256 MiB, as much as an image that is read may have


@contextmanager
def place_files(files: Mapping[str, Path], folder: Path, link: bool = False) -> Iterator[None]:
    """Files are in the cell while what follows uses them, and stay unless it fails.

    A file that is there already, the same to the byte, is left as it is.

    Args:
        files: By their path in the cell.
        folder: The cell.
        link: Whether they become hard links, so that nothing is stored twice, instead of copies.

    Raises:
        DatasetError: if one is no file, is larger than any image, or has an image's name and is none.
        InputError: if another file is there, a path leaves the cell, or it cannot be written.
    """
    made: list[Path] = []
    existed = folder.exists()
    try:
        path_in_cell = inside(str(folder))
        for name, source in files.items():
            target = folder / path_in_cell(name)
            if is_image(target):
                check_image(source)
            if not os.path.lexists(target):
                make_folder(target.parent, folder)
                made.append(target)
                _place_file(source, target, link)
            elif not target.is_file() or not filecmp.cmp(source, target, shallow=False):
                raise InputError(f"{target} is there already, and is another file than {source}: it is not overwritten")
        yield
    except OSError as error:
        _remove_files(made, folder, existed)
        raise InputError(f"{error.filename or folder} cannot be written: {error.strerror}") from None
    except BaseException:
        _remove_files(made, folder, existed)
        raise


@contextmanager
def scratch_folder(cell: str | Path) -> Iterator[TemporaryDirectory[str]]:
    """A temporary folder on the disk of a cell, which is gone if what follows fails."""
    beside = next(above for above in Path(cell).absolute().parents if above.exists())
    scratch = TemporaryDirectory(prefix=".import-", dir=beside)
    try:
        yield scratch
    except BaseException:
        scratch.cleanup()
        raise


def numbered_path(path: str, number: int) -> str:
    """Where an image is whose path is taken: the number of its sample before its name."""
    place = PurePosixPath(path)
    return str(place.with_name(f"{number:06d}_{place.name}"))


def _place_file(source: Path, target: Path, link: bool) -> None:
    if link:
        try:
            os.link(source, target)
        except OSError as error:
            why = f"{source} cannot be linked into {target.parent} ({error.strerror})"
            raise InputError(f"{why}: hard links need one disk; leave --link away to copy") from None
        return
    write_atomically(target, read_bounded(source, _LARGEST_BYTES), durable=False)


def _remove_files(files: list[Path], folder: Path, had_cell: bool) -> None:
    """Remove files that were made, and folders that are empty then; the cell itself only where it is new."""
    for path in files:
        with suppress(OSError):
            path.unlink(missing_ok=True)
    above = {parent for path in files for parent in path.parents if parent.is_relative_to(folder)}
    for parent in sorted(above, key=lambda path: len(path.parts), reverse=True):
        if parent != folder or not had_cell:
            with suppress(OSError):
                parent.rmdir()
