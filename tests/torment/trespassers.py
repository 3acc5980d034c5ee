"""What a tracer has to find, in place of a command: it opens what is outside, connects, or only asks what is there."""

from __future__ import annotations

import os
import socket
from contextlib import suppress
from pathlib import Path


def open_outside(words: list[str]) -> int:
    """Read a file beside the cell."""
    Path("../outside/eye.urdf").read_text()
    return 0


def connect(words: list[str]) -> int:
    """Connect to a port of this machine."""
    with suppress(OSError):
        socket.create_connection(("127.0.0.1", 9))
    return 0


def ask(words: list[str]) -> int:
    """Ask whether there is a file beside the cell."""
    return 0 if os.path.exists("../outside/eye.urdf") else 70
