"""Keys that are pressed while something else goes on."""

from __future__ import annotations

import io
import os
import sys

import pytest

from basecal.cli.keys import pressed_keys


def test_where_nobody_is_no_key_is_pressed(monkeypatch: pytest.MonkeyPatch) -> None:
    """A pipe or a closed stream gives none, and is not read."""
    for stream in (io.StringIO("q"), None):
        monkeypatch.setattr(sys, "stdin", stream)
        with pressed_keys() as key:
            assert key() == ""


@pytest.mark.skipif(sys.platform == "win32", reason="there are no pseudo-terminals")
def test_a_key_at_a_terminal_comes_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without a newline, once; the terminal is afterwards as it was before."""
    import pty
    import termios

    outside, inside = pty.openpty()
    before = termios.tcgetattr(inside)
    with os.fdopen(inside, "r") as stream:
        monkeypatch.setattr(sys, "stdin", stream)
        with pressed_keys() as key:
            assert key() == ""
            os.write(outside, b" ")
            assert key() == " "
            assert key() == ""
        assert termios.tcgetattr(stream.fileno()) == before
    os.close(outside)
