"""Jobs for tests, as functions that other processes can import."""

from __future__ import annotations

import os
import signal
import time
from importlib import metadata
from pathlib import Path


def named(number: int) -> bytes:
    """Return the number as text."""
    return str(number).encode()


def slowly(number: int) -> bytes:
    """Return what `named` returns, after 0.1 s."""
    time.sleep(0.1)
    return named(number)


def deadly(number: int) -> bytes:
    """Kill the process that runs it."""
    os.kill(os.getpid(), signal.SIGKILL)
    return b""


def deadly_once(mark: str, number: int) -> bytes:
    """Kill the first process that runs it; return what `named` returns after that."""
    if not Path(mark).exists():
        Path(mark).touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return named(number)


def wrong(number: int) -> bytes:
    """Raise a ZeroDivisionError."""
    raise ZeroDivisionError(f"job {number}")


def lacking(number: int) -> bytes:
    """Raise the error of a package that is not installed."""
    raise ModuleNotFoundError(f"No module named 'no_such_package' in job {number}")


def of_another_version() -> None:
    """Let the calling process report another version of every package from then on."""
    metadata.version = lambda name: "0.0.0"
