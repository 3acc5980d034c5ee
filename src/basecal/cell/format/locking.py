"""Lock of a cell's folder for one process at a time."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from basecal.errors import InputError


@contextmanager
def locked_folder(folder: Path) -> Iterator[None]:
    """Lock a folder until the context or the process ends; does nothing on systems without folder locks.

    Raises:
        InputError: if another process holds the lock, or the folder cannot be opened.
    """
    try:
        import fcntl
    except ImportError:  # Windows
        yield
        return
    try:
        descriptor = os.open(folder, os.O_RDONLY)
    except OSError as error:
        raise InputError(f"{folder} cannot be opened: {error.strerror}") from None
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(descriptor)
        raise InputError(
            f"{folder} is in use by another capture or driver check. Wait until it ends, or stop it"
        ) from None
    except OSError:  # some network drives do not support locks
        pass
    try:
        yield
    finally:
        os.close(descriptor)
