"""What a file holds, if it is a file, and not more than a file of its kind ever holds."""

from __future__ import annotations

import os
import stat
from pathlib import Path

from basecal.errors import DatasetError

_MB = 2**20


def read_bounded(path: str | Path, largest: int, missing: str = "") -> bytes:
    """The bytes of a regular file.

    Pipes, devices and folders are refused without waiting for them, and no more than `largest` bytes are ever held.

    Args:
        path: The file.
        largest: How many bytes it may have.
        missing: What to do where there is none.

    Raises:
        DatasetError: if it is not there, is no regular file, has more bytes, or cannot be read.
    """
    name = str(path)
    try:
        number = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
        with os.fdopen(number, "rb") as file:
            about = os.fstat(number)
            is_file, size = stat.S_ISREG(about.st_mode), about.st_size
            data = file.read(largest + 1) if is_file and size <= largest else b""
    except FileNotFoundError:
        raise DatasetError(name, f"cannot be read: there is no such file{f'; {missing}' if missing else ''}") from None
    except (OSError, ValueError) as error:
        raise DatasetError(name, f"cannot be read: {getattr(error, 'strerror', None) or error}") from None
    if not is_file:
        raise DatasetError(name, "is not a file but a pipe, a device or the like; copy what it gives into a file")
    if max(size, len(data)) > largest:  # some files say that they are empty and are not
        raise DatasetError(name, f"has more than {largest / _MB:.3g} MB, no such file has; is it the right one?")
    return data
