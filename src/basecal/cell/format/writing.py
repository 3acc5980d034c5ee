"""Files and folders written whole or not at all, and nothing through a link."""

from __future__ import annotations

import os
import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import IO, BinaryIO

from basecal.errors import InputError

_PART = ".part"  # at the end of a name of what is not whole yet
_NO_FOLLOW = getattr(os, "O_NOFOLLOW", 0)
_NEW = os.O_WRONLY | os.O_CREAT | os.O_EXCL | _NO_FOLLOW | getattr(os, "O_BINARY", 0)


def write_atomically(
    path: Path, content: str | bytes, *, base_folder: Path | None = None, durable: bool = True, mode: int = 0o666
) -> None:
    """Write a file so that a reader sees the old one or the new one, never a half, whenever this is cut off.

    Args:
        path: The file; a link of that name is replaced, not followed.
        content: What it holds then; text as UTF-8.
        base_folder: A folder above it, below which no folder may be a link.
        durable: Whether it is on the disk when this returns, and survives a loss of power.
        mode: Who may do what with it, less what the user's mask takes away.

    Raises:
        InputError: if it cannot be written.
    """
    part = temporary_path(path)
    try:
        with writing_errors(path):
            make_folder(path.parent, base_folder)
            with open_new(part, mode) as file:
                file.write(_as_bytes(content))
                file.flush()
                if durable:
                    os.fsync(file.fileno())
            os.replace(part, path)
            if durable:
                sync_folder(path.parent)
    finally:
        with suppress(OSError):
            part.unlink(missing_ok=True)


@contextmanager
def writing_errors(path: Path) -> Iterator[None]:
    """Errors of the system while a path is written, as one line that names it.

    Raises:
        InputError: in place of such an error.
    """
    try:
        yield
    except OSError as error:
        raise InputError(f"{path} cannot be written: {error.strerror}") from None


def _as_bytes(content: str | bytes) -> bytes:
    return content if isinstance(content, bytes) else content.encode("utf-8", "backslashreplace")


def write_private(path: Path, text: str, *, base_folder: Path | None = None) -> None:
    """Write a file that only its owner may read, whole or not at all; see `write_atomically`.

    Raises:
        InputError: if it cannot be written.
    """
    write_atomically(path, text, base_folder=base_folder, durable=False, mode=0o600)


def append_durably(path: Path, text: str, *, base_folder: Path | None = None) -> None:
    """Append to a file, which is made where it is not there; when this returns the disk has it.

    Raises:
        InputError: if it cannot be written.
    """
    with writing_errors(path):
        make_folder(path.parent, base_folder)
        with open_own(path, "ab") as file:
            file.write(_as_bytes(text))
            file.flush()
            os.fsync(file.fileno())
        sync_folder(path.parent)


def write_new(path: Path, text: str) -> None:
    """Write a file that is not there yet, whole or not at all.

    Raises:
        InputError: if there is one already, or it cannot be written.
    """
    if os.path.lexists(path):
        raise InputError(f"{path} exists and is not overwritten: choose another folder, or remove it first")
    write_atomically(path, text)


def write_output(path: Path, content: str | bytes) -> None:
    """Write a file of a name that was given: whole or not at all, but into what is a pipe or a device.

    Raises:
        InputError: if it cannot be written.
    """
    if not path.exists() or path.is_file():
        write_atomically(path, content)
        return
    with writing_errors(path):
        path.write_bytes(_as_bytes(content))


@contextmanager
def stage_folder(folder: Path) -> Iterator[Path]:
    """A new folder beside `folder`, to write into; at the end all that is in it appears in `folder` at once.

    Where `folder` holds something already, each entry appears alone, in the order of their names backwards, so that
    `recording` does before `cell.yaml`. Where this ends with an error nothing appears; cut off, it leaves a folder
    whose name starts with a dot and ends with `.part`.

    Raises:
        InputError: if it cannot be written.
    """
    part = temporary_path(Path(os.path.abspath(folder)))
    try:
        part.parent.mkdir(parents=True, exist_ok=True)
        part.mkdir()
        yield part
        _sync_all(part)
        _move_into_place(part, folder)
        sync_folder(part.parent)
    except OSError as error:
        raise InputError(f"{error.filename or folder} cannot be written: {error.strerror}") from None
    finally:
        shutil.rmtree(part, ignore_errors=True)


def make_folder(folder: Path, base_folder: Path | None = None) -> None:
    """Make a folder and those above it.

    Args:
        folder: The folder.
        base_folder: A folder above it, below which none may be a link.

    Raises:
        InputError: if one of them is a link.
        OSError: if it cannot be made.
    """
    if base_folder is not None:
        below = base_folder
        for part in folder.relative_to(base_folder).parts:
            below /= part
            if below.is_symlink():
                raise InputError(f"{below} is a link; what is written stays in the cell: put a folder there")
    folder.mkdir(parents=True, exist_ok=True)


def make_timed_folder(parent: Path, base_folder: Path) -> Path:
    """Make a folder whose name is the time in UTC, with a number where there is one of that second already.

    Args:
        parent: Where it is made; a folder that is made if need be.
        base_folder: A folder above it, below which none may be a link.

    Raises:
        InputError: if it cannot be made, or a folder above it is a link.
    """
    name = datetime.now(UTC).strftime("%Y%m%dT%H%M%SZ")
    folder, count = parent / name, 1
    while True:
        try:
            make_folder(parent, base_folder)
            folder.mkdir()
            sync_folder(parent)
        except FileExistsError:
            count += 1
            folder = parent / f"{name}-{count}"
        except OSError as error:
            raise InputError(f"{folder} cannot be made: {error.strerror}") from None
        else:
            return folder


def open_new(path: Path, mode: int = 0o666) -> BinaryIO:
    """A file that is not there yet, opened for writing; a link of its name is an error.

    Raises:
        OSError: if it cannot be made.
    """
    return os.fdopen(os.open(path, _NEW, mode), "wb")


def open_own(path: Path, mode: str) -> IO[bytes]:
    """A file opened as by `open`, but for a link, which is an error.

    Raises:
        OSError: if it cannot be opened.
    """
    return open(path, mode, opener=lambda name, flags: os.open(name, flags | _NO_FOLLOW, 0o666))


def temporary_path(path: Path) -> Path:
    """A name beside a path that nobody else takes."""
    return path.with_name(f".{path.name}.{secrets.token_hex(4)}{_PART}")


def is_unused(folder: Path) -> bool:
    """Whether a folder holds nothing, or only what a write that was cut off left."""
    return all(each.name.startswith(".") and each.name.endswith(_PART) for each in folder.iterdir())


def sync_folder(folder: Path) -> None:
    """Have the disk hold the names in a folder; where folders cannot be synchronised nothing is done."""
    with suppress(OSError):
        number = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(number)
        finally:
            os.close(number)


def _sync_all(folder: Path) -> None:
    for path in folder.rglob("*"):
        if path.is_file():
            with path.open("rb") as file:
                os.fsync(file.fileno())
        else:
            sync_folder(path)


def _move_into_place(part: Path, folder: Path) -> None:
    with suppress(OSError):
        part.rename(folder)  # also onto an empty one
        return
    for entry in sorted(part.iterdir(), key=lambda path: path.name, reverse=True):
        _merge(entry, folder / entry.name)


def _merge(entry: Path, to: Path) -> None:
    """Move a file, or what is in a folder, to where a folder may be already."""
    if to.is_dir() and entry.is_dir() and not to.is_symlink():
        for each in sorted(entry.iterdir()):
            _merge(each, to / each.name)
    else:
        entry.rename(to)
