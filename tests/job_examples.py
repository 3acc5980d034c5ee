"""Jobs for tests: functions that other processes can import."""

from __future__ import annotations

import os
import signal
import time
from importlib import metadata
from pathlib import Path


def named(number: int) -> bytes:
    """The number, as text."""
    return str(number).encode()


def slowly(number: int) -> bytes:
    """As `named`, after a moment."""
    time.sleep(0.1)
    return named(number)


def deadly(number: int) -> bytes:
    """Kills whoever does it."""
    os.kill(os.getpid(), signal.SIGKILL)
    return b""


def deadly_once(mark: str, number: int) -> bytes:
    """Kills the first that does it."""
    if not Path(mark).exists():
        Path(mark).touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return named(number)


def wrong(number: int) -> bytes:
    """Is a fault."""
    raise ZeroDivisionError(f"job {number}")


def lacking(number: int) -> bytes:
    """Needs what is not installed."""
    raise ModuleNotFoundError(f"No module named 'no_such_package' in job {number}")


def of_another_version() -> None:
    """Whoever calls it says from then on that it has another version of every package."""
    metadata.version = lambda name: "0.0.0"
