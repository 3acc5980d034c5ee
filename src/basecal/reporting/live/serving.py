"""A local page: NiceGUI serves it, from this machine to this machine, to whoever has its token."""

from __future__ import annotations

import secrets
import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from basecal.errors import InputError, MissingExtra
from basecal.reporting.live.guard import Guard

HOST = "127.0.0.1"
"""The only address a page is served on."""

_TOKEN_BYTES = 24
_START_TIMEOUT_S = 30.0  # until it is served

Build = Callable[[Any, Any], None]
"""Makes the page, of NiceGUI's `ui` and of what runs work beside it in a thread."""


@contextmanager
def serving(build: Build, title: str, subject: str, port: int = 0) -> Iterator[str]:
    """The address of a page while this lasts, with the token it asks for.

    Args:
        build: Makes it for each visitor.
        title: Of the page.
        subject: It is, in words, where NiceGUI is missing.
        port: Where it is served; any that is free where 0.

    Raises:
        MissingExtra: if NiceGUI is not installed.
        InputError: if the port is taken.
    """
    try:
        import uvicorn
        from fastapi import FastAPI
        from nicegui import run, ui
    except ImportError:
        raise MissingExtra("web", subject) from None
    token = secrets.token_urlsafe(_TOKEN_BYTES)
    line = _listening(port)
    at = f"{HOST}:{line.getsockname()[1]}"
    inside = FastAPI(docs_url=None, redoc_url=None, openapi_url=None)
    ui.run_with(inside, root=lambda: build(ui, run.io_bound), title=title, show_welcome_message=False, dark=None)
    guard = Guard(inside, token, [at, at.replace(HOST, "localhost")])
    server = uvicorn.Server(uvicorn.Config(guard, log_level="error", ws_max_size=2**20))
    thread = threading.Thread(target=server.run, kwargs={"sockets": [line]}, daemon=True)
    thread.start()
    until = time.monotonic() + _START_TIMEOUT_S
    while not server.started and thread.is_alive() and time.monotonic() < until:
        time.sleep(0.02)
    try:
        yield f"http://{at}/?token={token}"
    finally:
        server.should_exit = True
        thread.join(_START_TIMEOUT_S)


def _listening(port: int) -> socket.socket:
    line = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    line.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        line.bind((HOST, port))
    except OSError as error:
        line.close()
        raise InputError(f"port {port} cannot be used ({error.strerror}): choose another") from None
    return line
