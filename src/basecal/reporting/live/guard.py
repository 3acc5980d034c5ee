"""Who may see a local page: whoever has its token, from the page itself; nothing it holds asks another machine."""

from __future__ import annotations

import hmac
from collections.abc import Awaitable, Callable, Iterable, MutableMapping
from http.cookies import CookieError, SimpleCookie
from typing import Any
from urllib.parse import parse_qs

_CONTENT_POLICY = (
    "default-src 'self'; script-src 'self' 'unsafe-inline' 'unsafe-eval'; style-src 'self' 'unsafe-inline'; "
    "img-src 'self' data:; font-src 'self' data:; connect-src 'self'; frame-ancestors 'none'; base-uri 'none'; "
    "form-action 'none'"
)
"""What the page may load: from where it came, and nowhere else."""

Scope = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[MutableMapping[str, Any]]]
Send = Callable[[MutableMapping[str, Any]], Awaitable[None]]
Application = Callable[[Scope, Receive, Send], Awaitable[None]]


class Guard:
    """An application that others reach only with its token, requested by its own name."""

    def __init__(self, application: Application, token: str, hosts: Iterable[str]) -> None:
        self._inside, self._token, self._hosts = application, token, frozenset(hosts)
        port = min(self._hosts).rpartition(":")[2]
        self._cookie = f"basecal_{port}"  # browsers send cookies of one port to all ports of a host

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer, or refuse."""
        if scope["type"] == "lifespan":
            await self._inside(scope, receive, send)
            return
        why = self._refusal_reason(scope)
        if why and scope["type"] == "websocket":
            await send({"type": "websocket.close", "code": 1008})
        elif why:
            headers = [(b"content-type", b"text/plain; charset=utf-8")]
            await send({"type": "http.response.start", "status": 403, "headers": headers})
            await send({"type": "http.response.body", "body": f"refused: {why}\n".encode()})
        else:
            await self._inside(scope, receive, self._add_headers(send))

    def _refusal_reason(self, scope: Scope) -> str:
        headers = {name.decode("latin-1"): value.decode("latin-1") for name, value in scope["headers"]}
        if headers.get("host") not in self._hosts:
            return "the page is requested by another name than its own"
        origin = headers.get("origin")
        if origin is not None and origin.partition("://")[2] not in self._hosts:
            return "another page asks"
        given = [
            *parse_qs(scope.get("query_string", b"").decode("latin-1")).get("token", []),
            *_cookies(headers, self._cookie),
        ]
        if not any(hmac.compare_digest(each.encode(), self._token.encode()) for each in given):
            return "the token is missing or wrong: open the address that was printed"
        return ""

    def _add_headers(self, send: Send) -> Send:
        cookie = f"{self._cookie}={self._token}; HttpOnly; SameSite=Strict; Path=/"
        more = [
            (b"set-cookie", cookie.encode()),
            (b"content-security-policy", _CONTENT_POLICY.encode()),
            (b"referrer-policy", b"no-referrer"),
            (b"x-content-type-options", b"nosniff"),
        ]

        async def send_message(message: MutableMapping[str, Any]) -> None:
            """Send on, a response's start with these headers."""
            if message["type"] == "http.response.start":
                message["headers"] = [*message.get("headers", []), *more]
            await send(message)

        return send_message


def _cookies(headers: MutableMapping[str, str], name: str) -> list[str]:
    try:
        found = SimpleCookie(headers.get("cookie", "")).get(name)
    except CookieError:
        return []
    return [] if found is None else [found.value]
