"""A local page: what is refused before it is served. What it serves stands in the tests of the pages."""

from __future__ import annotations

import socket
import sys

import pytest

from basecal.errors import InputError, MissingExtra
from basecal.reporting.live.serving import HOST, serving


def build(ui, beside) -> None:
    """An empty page."""


def test_without_nicegui_the_extra_is_named(monkeypatch) -> None:
    """With what it is for."""
    monkeypatch.setitem(sys.modules, "nicegui", None)
    with (
        pytest.raises(MissingExtra, match=r"the page of a test.*basecal\[web\]"),
        serving(build, "t", "the page of a test"),
    ):
        pass


def test_a_port_that_is_taken_is_told() -> None:
    """In a line."""
    pytest.importorskip("nicegui", reason="nicegui is not installed: pip install 'basecal[web]'")
    with socket.socket() as line:
        line.bind((HOST, 0))
        line.listen()
        with pytest.raises(InputError, match="cannot be used"), serving(build, "t", "a page", line.getsockname()[1]):
            pass
