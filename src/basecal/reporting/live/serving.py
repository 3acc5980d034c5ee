"""A local HTTP server for pages, on this machine only, for requests with its token."""

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
"""Address of the server."""

_TOKEN_BYTES = 24
TIMEOUT_S = 10.0
"""Timeout of a connection without further data [s]."""

_STOP_POLL_S = 0.05
_HEADERS = {
    "Content-Security-Policy": "frame-ancestors 'none'",  # the rest of the policy is in the page
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "Cache-Control": "no-store",
}


@dataclass(frozen=True)
class Answer:
    """Body of a response, and its media type."""

    text: str
    kind: str = "text/html"


Route = Callable[[Mapping[str, str]], Answer]
"""Function that answers a request from the parameters of its address."""


@contextmanager
def serving(routes: Mapping[tuple[str, str], Route], port: int = 0) -> Iterator[str]:
    """A context that serves routes and yields the address with the token.

    Args:
        routes: Routes by method and path, such as `("GET", "/")`.
        port: Port of the server; 0 selects a free one.

    Raises:
        InputError: if the port is in use.
    """
    token = secrets.token_urlsafe(_TOKEN_BYTES)
    try:
        server = _Server((HOST, port), _Handler)
    except OSError as error:
        raise InputError(f"port {port} cannot be used ({error.strerror}): choose another") from None
    host = f"{HOST}:{server.server_address[1]}"
    server.guard, server.routes = Guard(token, (host, host.replace(HOST, "localhost"))), routes
    threading.Thread(target=server.serve_forever, args=(_STOP_POLL_S,), daemon=True).start()
    try:
        yield f"http://{host}/?token={token}"
    finally:
        server.shutdown()
        server.server_close()


class _Server(socketserver.ThreadingTCPServer):
    """A server with a thread for each request; it does not wait for threads at the end."""

    allow_reuse_address = True
    daemon_threads = True
    block_on_close = False
    request_queue_size = 64  # pending connections: with a short queue, stalled peers would delay the page
    guard: Guard
    routes: Mapping[tuple[str, str], Route]

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self._faults: dict[str, str] = {}

    def describe(self, error: Exception) -> str:
        """One line about a fault, which is printed only once, since a page may repeat a request."""
        fault = f"{type(error).__name__}: {error}"
        if fault not in self._faults:
            self._faults[fault] = printable(" ".join(describe_fault(error).split()))
            if sys.stderr is not None:
                print(f"basecal: error: {self._faults[fault]}", file=sys.stderr, flush=True)
        return self._faults[fault]

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Ignore errors of connections, such as of a closed browser."""


class _Handler(BaseHTTPRequestHandler):
    timeout = TIMEOUT_S
    server: _Server

    def do_GET(self) -> None:
        """Answer or refuse a request."""
        address = urlsplit(self.path)
        query = dict(parse_qsl(address.query))
        headers = {name.lower(): value for name, value in self.headers.items()}
        route = self.server.routes.get((self.command, address.path))
        if why := self.server.guard.refusal_reason(self.command, query, headers):
            self._send(403, Answer(f"refused: {why}\n", "text/plain"))
        elif route is None:
            self._send(404, Answer("no such page\n", "text/plain"))
        else:
            self._send(*self._run(route, query))

    do_POST = do_GET

    def _run(self, route: Route, query: Mapping[str, str]) -> tuple[int, Answer]:
        """Status and answer of a route; a fault of the program is also printed once to stderr."""
        try:
            return 200, route(query)
        except BasecalError as error:
            line = str(error)
        except Exception as error:
            line = self.server.describe(error)
        return 500, Answer(f"{line}\n", "text/plain")

    def _send(self, status: int, answer: Answer) -> None:
        """Send a response; the cookie is set if the status is 200."""
        body, guard = answer.text.encode(), self.server.guard
        self.send_response(status)
        headers = {"Content-Type": f"{answer.kind}; charset=utf-8", "Content-Length": str(len(body)), **_HEADERS}
        if status == 200:
            headers["Set-Cookie"] = f"{guard.cookie}={guard.token}; HttpOnly; SameSite=Strict; Path=/"
        for name, value in headers.items():
            self.send_header(name, value)
        self.end_headers()
        self.wfile.write(body)

    def version_string(self) -> str:
        """Name of the server without versions."""
        return "basecal"

    def log_message(self, format: str, *arguments: Any) -> None:
        """Suppress the log of requests."""
