"""Who may see a local page."""

from __future__ import annotations

import asyncio

import pytest

from basecal.reporting.live.guard import Guard

HOST = "127.0.0.1:5000"


def answered(kind="http", query="", **headers):
    """What is sent to who asks, and whether the application was reached."""
    sent, reached = [], []

    async def inside(scope, receive, send):
        reached.append(scope)
        await send({"type": f"{kind}.response.start", "status": 200, "headers": [(b"a", b"b")]})

    async def send(message):
        sent.append(message)

    scope = {
        "type": kind,
        "query_string": query.encode(),
        "headers": [(name.encode(), value.encode()) for name, value in {"host": HOST, **headers}.items()],
    }
    asyncio.run(Guard(inside, "secret", [HOST])(scope, None, send))
    return sent, bool(reached)


@pytest.mark.parametrize("given", [{"query": "token=secret"}, {"cookie": "x=1; basecal_5000=secret"}])
def test_the_token_opens(given):
    """In the address or the cookie that comes with the first answer; the page may then ask its own host alone."""
    sent, reached = answered(**given)
    headers = dict(sent[0]["headers"])
    assert reached
    assert headers[b"a"] == b"b"
    assert b"HttpOnly; SameSite=Strict" in headers[b"set-cookie"]
    assert b"default-src 'self'" in headers[b"content-security-policy"]


@pytest.mark.parametrize(
    "given",
    [
        {},
        {"query": "token=secre"},
        {"query": "token="},
        {"cookie": "basecal_5000=other"},
        {"cookie": "basecal_5001=secret"},
        {"cookie": "=;=;"},
        {"query": "token=secret", "host": "evil.example"},
        {"query": "token=secret", "origin": "http://evil.example"},
        {"query": "token=secret", "origin": "null"},
    ],
)
@pytest.mark.parametrize("kind", ["http", "websocket"])
def test_all_else_is_refused(kind, given):
    """A missing or wrong token, another name, another page: nothing behind it is reached."""
    sent, reached = answered(kind, **given)
    assert not reached
    assert sent[0].get("status", 403) == 403
    assert sent[0]["type"] == ("websocket.close" if kind == "websocket" else "http.response.start")


def test_its_own_page_is_no_other_origin():
    """A request that names the page itself as its origin is answered."""
    assert answered(query="token=secret", origin=f"http://{HOST}")[1]
