"""Keys that a person presses while something else goes on."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager


@contextmanager
def pressed_keys() -> Iterator[Callable[[], str]]:
    """A reader of the key that was pressed since the last call; always empty if no person is at a terminal."""
    stream = sys.stdin
    if stream is None or not stream.isatty() or sys.platform == "win32":
        yield lambda: ""
        return
    import select
    import termios
    import tty

    number = stream.fileno()
    before = termios.tcgetattr(number)
    tty.setcbreak(number)
    try:
        yield lambda: stream.read(1) if select.select([stream], [], [], 0)[0] else ""
    finally:
        termios.tcsetattr(number, termios.TCSADRAIN, before)
