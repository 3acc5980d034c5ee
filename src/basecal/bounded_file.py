"""Content of a regular file of bounded size."""

from __future__ import annotations

import os
import stat
from pathlib import Path

from basecal.errors import DatasetError

_MB = 2**20
_NO_FILE = "is not a file but a pipe, a device or the like; copy what it gives into a file"


class MissingFile(DatasetError):
    """A file that is not there."""


def read_bounded(path: str | Path, largest: int, missing: str = "") -> bytes:
    """The bytes of a regular file.

    Pipes, devices and folders are refused without waiting for them, and no more than `largest` bytes are ever held.

    Args:
        path: The file.
        largest: How many bytes it may have.
        missing: What to do where there is none.

    Raises:
        MissingFile: if it is not there.
        DatasetError: if it is no regular file, has more bytes, or cannot be read.
    """
    name = str(path)
    try:
        number, about = _open_descriptor(path)
        with os.fdopen(number, "rb") as file:
            is_file, size = stat.S_ISREG(about.st_mode), about.st_size
            data = file.read(largest + 1) if is_file and size <= largest else b""
    except FileNotFoundError:
        raise MissingFile(name, f"cannot be read: there is no such file{f'; {missing}' if missing else ''}") from None
    except (OSError, ValueError) as error:
        raise DatasetError(name, f"cannot be read: {getattr(error, 'strerror', None) or error}") from None
    if not is_file:
        raise DatasetError(name, _NO_FILE)
    if max(size, len(data)) > largest:  # some files say that they are empty and are not
        raise DatasetError(name, f"has more than {largest / _MB:.3g} MB, no such file has; is it the right one?")
    return data


def check_regular(path: str | Path) -> None:
    """Check that others may read a file by its name without end: it is no pipe and no device.

    Raises:
        DatasetError: if it is one, is not there, or cannot be read.
    """
    try:
        number, about = _open_descriptor(path)
        os.close(number)
    except (OSError, ValueError) as error:
        raise DatasetError(path, f"cannot be read: {getattr(error, 'strerror', None) or error}") from None
    if not stat.S_ISREG(about.st_mode) and not stat.S_ISDIR(about.st_mode):
        raise DatasetError(path, _NO_FILE)


def _open_descriptor(path: str | Path) -> tuple[int, os.stat_result]:
    number = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
    return number, os.fstat(number)
