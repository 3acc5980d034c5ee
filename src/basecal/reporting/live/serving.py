"""A local page, served from this machine to this machine, to whoever has its token."""

from __future__ import annotations

import secrets
import socketserver
import sys
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from http.server import BaseHTTPRequestHandler
from typing import Any
from urllib.parse import parse_qsl, urlsplit

from basecal.errors import BasecalError, InputError, describe_fault, printable
from basecal.reporting.live.guard import Guard

HOST = "127.0.0.1"
"""The only address a page is served on."""

_TOKEN_BYTES = 24
PATIENCE_S = 10.0
"""With a browser that says nothing more [s]."""

_STOP_POLL_S = 0.05
_HEADERS = {
    "Content-Security-Policy": "frame-ancestors 'none'",  # the rest is in the page itself
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "Cache-Control": "no-store",
}


@dataclass(frozen=True)
class Answer:
    """An answer to a browser, and its media type."""

    text: str
    kind: str = "text/html"


Route = Callable[[Mapping[str, str]], Answer]
"""Answers a request by the parameters of its address."""


@contextmanager
def serving(routes: Mapping[tuple[str, str], Route], port: int = 0) -> Iterator[str]:
    """The address of a page while this lasts, with the token it asks for.

    Args:
        routes: By method and path, such as `("GET", "/")`.
        port: Where it is served; any that is free where 0.

    Raises:
        InputError: if the port is taken.
    """
    token = secrets.token_urlsafe(_TOKEN_BYTES)
    try:
        server = _Server((HOST, port), _Handler)
    except OSError as error:
        raise InputError(f"port {port} cannot be used ({error.strerror}): choose another") from None
    at = f"{HOST}:{server.server_address[1]}"
    server.guard, server.routes = Guard(token, (at, at.replace(HOST, "localhost"))), routes
    threading.Thread(target=server.serve_forever, args=(_STOP_POLL_S,), daemon=True).start()
    try:
        yield f"http://{at}/?token={token}"
    finally:
        server.shutdown()
        server.server_close()


class _Server(socketserver.ThreadingTCPServer):
    """A thread for each request; none is waited for at the end."""

    allow_reuse_address = True
    daemon_threads = True
    block_on_close = False
    request_queue_size = 64  # connections that wait: of more, peers that freeze would delay the page
    guard: Guard
    routes: Mapping[tuple[str, str], Route]

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self._faults: dict[str, str] = {}

    def describe(self, error: Exception) -> str:
        """One line about a fault, which is printed once: a page may ask for the same many times."""
        fault = f"{type(error).__name__}: {error}"
        if fault not in self._faults:
            self._faults[fault] = printable(" ".join(describe_fault(error).split()))
            if sys.stderr is not None:
                print(f"basecal: error: {self._faults[fault]}", file=sys.stderr, flush=True)
        return self._faults[fault]

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Leave the terminal to the command: a browser that went away is no error of it."""


class _Handler(BaseHTTPRequestHandler):
    timeout = PATIENCE_S
    server: _Server

    def do_GET(self) -> None:
        """Answer, or refuse."""
        address = urlsplit(self.path)
        query = dict(parse_qsl(address.query))
        headers = {name.lower(): value for name, value in self.headers.items()}
        route = self.server.routes.get((self.command, address.path))
        if why := self.server.guard.refusal_reason(self.command, query, headers):
            self._send(403, Answer(f"refused: {why}\n", "text/plain"))
        elif route is None:
            self._send(404, Answer("there is no such page\n", "text/plain"))
        else:
            self._send(*self._run(route, query))

    do_POST = do_GET

    def _run(self, route: Route, query: Mapping[str, str]) -> tuple[int, Answer]:
        """Status and answer of a route; a fault of the program is also one line on stderr, once."""
        try:
            return 200, route(query)
        except BasecalError as error:
            line = str(error)
        except Exception as error:
            line = self.server.describe(error)
        return 500, Answer(f"{line}\n", "text/plain")

    def _send(self, status: int, answer: Answer) -> None:
        """Answer; with the cookie where all is well."""
        body, guard = answer.text.encode(), self.server.guard
        self.send_response(status)
        about = {"Content-Type": f"{answer.kind}; charset=utf-8", "Content-Length": str(len(body)), **_HEADERS}
        if status == 200:
            about["Set-Cookie"] = f"{guard.cookie}={guard.token}; HttpOnly; SameSite=Strict; Path=/"
        for name, value in about.items():
            self.send_header(name, value)
        self.end_headers()
        self.wfile.write(body)

    def version_string(self) -> str:
        """Name the program, without versions of what serves it."""
        return "basecal"

    def log_message(self, format: str, *arguments: Any) -> None:
        """Leave the terminal to the command."""
