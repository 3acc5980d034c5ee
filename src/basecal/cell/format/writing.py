"""Atomic writing of files and folders, without following symbolic links."""

from __future__ import annotations

import json
import os
import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import IO, BinaryIO

from basecal.errors import InputError

_PART = ".part"  # suffix of incomplete files and folders
_NO_FOLLOW = getattr(os, "O_NOFOLLOW", 0)
_NEW = os.O_WRONLY | os.O_CREAT | os.O_EXCL | _NO_FOLLOW | getattr(os, "O_BINARY", 0)


def write_atomically(
    path: Path, content: str | bytes, *, base_folder: Path | None = None, durable: bool = True, mode: int = 0o666
) -> None:
    """Write a file atomically: a reader sees the old or the new content, even if writing is interrupted.

    Args:
        path: The file; a link of that name is replaced, not followed.
        content: New content; text is encoded as UTF-8.
        base_folder: A parent folder of the file, below which no folder may be a link.
        durable: Whether to flush the file to the disk, so that it survives a loss of power.
        mode: File permissions, before the user's umask is applied.

    Raises:
        InputError: if the file cannot be written.
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
    """Convert operating system errors while writing a path to one-line errors that name the path.

    Raises:
        InputError: instead of an OSError.
    """
    try:
        yield
    except OSError as error:
        raise InputError(f"{path} cannot be written: {error.strerror}") from None


def _as_bytes(content: str | bytes) -> bytes:
    return content if isinstance(content, bytes) else content.encode("utf-8", "backslashreplace")


def write_private(path: Path, text: str, *, base_folder: Path | None = None) -> None:
    """Write a file atomically that only its owner may read; see `write_atomically`.

    Raises:
        InputError: if the file cannot be written.
    """
    write_atomically(path, text, base_folder=base_folder, durable=False, mode=0o600)


def append_durably(path: Path, text: str, *, base_folder: Path | None = None) -> int:
    """Append lines of JSON to a file, create it if it is missing, and flush it to the disk.

    A last line without a newline, which an interrupted write left, is completed if it is valid JSON, otherwise removed.

    Returns:
        Number of the removed line, from 1; 0 if none was removed.

    Raises:
        InputError: if the file cannot be written.
    """
    with writing_errors(path):
        make_folder(path.parent, base_folder)
        removed_line = _end_last_line(path) if path.exists() else 0
        with open_without_links(path, "ab") as file:
            file.write(_as_bytes(text))
            file.flush()
            os.fsync(file.fileno())
        sync_folder(path.parent)
    return removed_line


def _end_last_line(path: Path) -> int:
    """End a file with a newline; return the number of the line that had to be removed, else 0."""
    with open_without_links(path, "r+b") as file:
        size = file.seek(0, os.SEEK_END)
        file.seek(max(size - 1, 0))
        if file.read(1) in (b"", b"\n"):
            return 0
        file.seek(0)
        text = file.read()
        end = text.rfind(b"\n") + 1
        if is_json(text[end:]):
            file.write(b"\n")
            return 0
        file.truncate(end)
    return text.count(b"\n") + 1


def is_json(line: bytes) -> bool:
    """Whether a line is complete: valid JSON, so that no part of it is missing."""
    try:
        json.loads(line.decode())
    except (ValueError, RecursionError):
        return False
    return True


def write_new(path: Path, text: str) -> None:
    """Write a new file atomically.

    Raises:
        InputError: if the file exists or cannot be written.
    """
    if os.path.lexists(path):
        raise InputError(f"{path} exists and is not overwritten: choose another folder, or remove it first")
    write_atomically(path, text)


def write_output(path: Path, content: str | bytes) -> None:
    """Write an output file named by the user: atomically, or directly if it is a pipe or a device.

    Raises:
        InputError: if the file cannot be written.
    """
    if not path.exists() or path.is_file():
        write_atomically(path, content)
        return
    with writing_errors(path):
        path.write_bytes(_as_bytes(content))


@contextmanager
def stage_folder(folder: Path) -> Iterator[Path]:
    """Create a temporary folder next to `folder` to write into, and move its content to `folder` at the end.

    The move is atomic if `folder` is new or empty. Otherwise entries are moved one by one in reverse order of their
    names, so that `recording` appears before `cell.yaml`. After an error nothing is moved. An interrupted process
    leaves a folder whose name starts with a dot and ends with `.part`.

    Raises:
        InputError: if the folder cannot be written.
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
    """Create a folder and its parents.

    Args:
        folder: The folder.
        base_folder: A parent of the folder, below which no folder may be a link.

    Raises:
        InputError: if a folder below `base_folder` is a link.
        OSError: if the folder cannot be created.
    """
    if base_folder is not None:
        below = base_folder
        for part in folder.relative_to(base_folder).parts:
            below /= part
            if below.is_symlink():
                raise InputError(f"{below} is a link, and files are written only inside the cell: put a folder there")
    folder.mkdir(parents=True, exist_ok=True)


def make_timed_folder(parent: Path, base_folder: Path) -> Path:
    """Create a folder named after the UTC time, with a number appended if that name exists.

    Args:
        parent: The parent folder; created if missing.
        base_folder: A folder above `parent`, below which no folder may be a link.

    Raises:
        InputError: if the folder cannot be created, or a folder below `base_folder` is a link.
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
    """Create a new file and open it for writing.

    Raises:
        OSError: if the file cannot be created, or a file or link of that name exists.
    """
    return os.fdopen(os.open(path, _NEW, mode), "wb")


def open_without_links(path: Path, mode: str) -> IO[bytes]:
    """Open a file like `open`, but do not follow a link.

    Raises:
        OSError: if the file cannot be opened or is a link.
    """
    return open(path, mode, opener=lambda name, flags: os.open(name, flags | _NO_FOLLOW, 0o666))


def temporary_path(path: Path) -> Path:
    """Random hidden name in the same folder for a temporary file or folder."""
    return path.with_name(f".{path.name}.{secrets.token_hex(4)}{_PART}")


def is_unused(folder: Path) -> bool:
    """Whether a folder is empty, apart from the remains of interrupted writes."""
    return all(each.name.startswith(".") and each.name.endswith(_PART) for each in folder.iterdir())


def sync_folder(folder: Path) -> None:
    """Flush the entries of a folder to the disk, if the system supports it."""
    with suppress(OSError):
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


def _sync_all(folder: Path) -> None:
    for path in folder.rglob("*"):
        if path.is_file():
            with path.open("rb") as file:
                os.fsync(file.fileno())
        else:
            sync_folder(path)


def _move_into_place(part: Path, folder: Path) -> None:
    with suppress(OSError):
        part.rename(folder)  # also replaces an empty folder
        return
    for entry in sorted(part.iterdir(), key=lambda path: path.name, reverse=True):
        _merge(entry, folder / entry.name)


def _merge(entry: Path, destination: Path) -> None:
    """Move a file or folder to a path; merge it with a folder that exists there."""
    if destination.is_dir() and entry.is_dir() and not destination.is_symlink():
        for each in sorted(entry.iterdir()):
            _merge(each, destination / each.name)
    else:
        entry.rename(destination)
