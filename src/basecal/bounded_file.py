"""Read regular files of bounded size."""

from __future__ import annotations

import os
import stat
from pathlib import Path

from basecal.errors import DatasetError

_MB = 2**20
_NO_FILE = "is not a file but a pipe, a device or the like; copy its content into a file"


class MissingFile(DatasetError):
    """A file does not exist."""


def read_bounded(path: str | Path, largest: int, missing: str = "") -> bytes:
    """Read the bytes of a regular file.

    Pipes, devices and folders are rejected without blocking, and at most `largest` + 1 bytes are read.

    Args:
        path: The file.
        largest: Largest size [bytes].
        missing: Advice for the error message if the file does not exist.

    Raises:
        MissingFile: if the file does not exist.
        DatasetError: if the path is not a regular file, the file is too large, or it cannot be read.
    """
    name = str(path)
    try:
        descriptor, status = _open_descriptor(path)
        with os.fdopen(descriptor, "rb") as file:
            is_file, size = stat.S_ISREG(status.st_mode), status.st_size
            data = file.read(largest + 1) if is_file and size <= largest else b""
    except FileNotFoundError:
        raise MissingFile(name, f"cannot be read: there is no such file{f'; {missing}' if missing else ''}") from None
    except (OSError, ValueError) as error:
        raise DatasetError(name, f"cannot be read: {getattr(error, 'strerror', None) or error}") from None
    if not is_file:
        raise DatasetError(name, _NO_FILE)
    if max(size, len(data)) > largest:  # some special files report size zero
        raise DatasetError(name, f"has more than {largest / _MB:.3g} MB, the limit of such files; is it the right one?")
    return data


def check_regular(path: str | Path) -> None:
    """Check that a path is a regular file or a folder, not a pipe or device, on which a reader could block.

    Raises:
        DatasetError: if it is a pipe or device, does not exist, or cannot be read.
    """
    try:
        descriptor, status = _open_descriptor(path)
        os.close(descriptor)
    except (OSError, ValueError) as error:
        raise DatasetError(path, f"cannot be read: {getattr(error, 'strerror', None) or error}") from None
    if not stat.S_ISREG(status.st_mode) and not stat.S_ISDIR(status.st_mode):
        raise DatasetError(path, _NO_FILE)


def _open_descriptor(path: str | Path) -> tuple[int, os.stat_result]:
    descriptor = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
    return descriptor, os.fstat(descriptor)
