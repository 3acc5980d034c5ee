"""A robot that answers OPC UA in a separate process, and its place in a cell."""

from __future__ import annotations

import socket
from contextlib import contextmanager
from pathlib import Path

from basecal.acquisition.driver import Place
from shared.facing_arms import facing_arms
from shared.second_process import second_process

CELL = facing_arms("led").cell


def free_port():
    """A free port of this computer."""
    with socket.socket() as line:
        line.bind(("127.0.0.1", 0))
        return line.getsockname()[1]


@contextmanager
def opcua_robot():
    """A server with its `port`, and the `place` of its robot in a cell with URDFs."""
    port = free_port()
    url = f"opc.tcp://127.0.0.1:{port}/robot"
    with second_process("shared.opcua_robot", port) as process:
        process.port = port
        process.place = lambda **options: Place("eye", CELL, Path("."), {"url": url, "reconnect_s": 1.0, **options})
        yield process
