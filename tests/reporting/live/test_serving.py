"""Tests of serving a local page and of refused requests."""

from __future__ import annotations

import socket
import struct
import urllib.error
import urllib.request
from urllib.parse import urlsplit

import pytest

from basecal.errors import InputError
from basecal.reporting.live import serving as module
from basecal.reporting.live.serving import HOST, TIMEOUT_S, Answer, serving

ROUTES = {
    ("GET", "/"): lambda query: Answer(f"hello {query.get('name', '')}"),
    ("POST", "/"): lambda query: Answer("!"),
}


def answer(address, method="GET", **headers):
    """Status, headers and words of an answer."""
    request = urllib.request.Request(address, method=method, headers=headers)
    try:
        with urllib.request.urlopen(request, timeout=20) as found:
            return found.status, found.headers, found.read().decode()
    except urllib.error.HTTPError as refused:
        return refused.code, refused.headers, refused.read().decode()


def test_serving_requires_the_token():
    """The page is served by its own name, on this machine only. Its cookie grants access to the other routes."""
    with serving(ROUTES) as address:
        bare = address.partition("?")[0]
        at = urlsplit(address)
        status, headers, words = answer(f"{address}&name=you")
        assert (status, words) == (200, "hello you")
        cookie = headers["Set-Cookie"]
        assert cookie.startswith(f"basecal_{at.port}=")
        assert "HttpOnly; SameSite=Strict" in cookie
        assert headers["Content-Security-Policy"] == "frame-ancestors 'none'"
        assert at.hostname == HOST
        assert [answer(each)[0] for each in (bare, f"{bare}?token=wrong", f"{bare}other")] == [403] * 3
        assert answer(f"{bare}other?token={at.query.partition('=')[2]}")[0] == 404
        assert answer(address, Host="evil.example")[0] == 403
        own = {"Cookie": cookie.partition(";")[0]}
        assert answer(bare, "POST", **own)[0] == 403
        assert answer(bare, "POST", **own, Origin=bare.rstrip("/"))[0] == 200
        assert answer(bare, "DELETE", **own)[0] == 501
    with pytest.raises(OSError, match="refused"):
        answer(address)


def test_route_error_is_sent_as_text():
    """The message of an input error is sent with status 500, so that a page can show it."""

    def fail(query):
        raise InputError("calibrate again")

    with serving({("GET", "/"): fail}) as address:
        status, _, words = answer(address)
    assert (status, words) == (500, "calibrate again\n")


def test_route_fault_is_printed_once(capfd):
    """The page gets status 500 and the line of the terminal, which is printed once, however often the page asks."""

    def fail(query):
        raise ZeroDivisionError("slice step\ncannot be zero")

    with serving({("GET", "/"): fail}) as address:
        (status, _, words), again = answer(address), answer(address)
    printed = capfd.readouterr().err
    assert (status, again[0], again[2]) == (500, 500, words)
    assert words.startswith("a fault of basecal itself (ZeroDivisionError: slice step cannot be zero); please report")
    assert printed == f"basecal: error: {words}"


def test_used_port_is_reported():
    """The error is one line."""
    with socket.socket() as line:
        line.bind((HOST, 0))
        line.listen()
        with pytest.raises(InputError, match="cannot be used"), serving(ROUTES, line.getsockname()[1]):
            pass


def test_faulty_clients_do_not_block_others():
    """Others are answered within half of the timeout while clients are frozen, invalid or disconnected.

    The server then stops at once.
    """
    lies = (
        b"",
        b"GET / HT",
        b"POST / HTTP/1.1\r\nContent-Length: 1000000000\r\n\r\n",
        b"\x16\x03\x01" + bytes(200),
        b"\n" * 9,
    )
    with serving(ROUTES) as address:
        at = urlsplit(address)
        frozen = [socket.create_connection((HOST, at.port)) for _ in range(8 * len(lies))]
        for line, lie in zip(frozen, lies * 8, strict=True):
            line.sendall(lie)
        for line in frozen[::2]:  # these disconnect
            line.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
            line.close()
        with urllib.request.urlopen(address, timeout=TIMEOUT_S / 2) as found:
            assert found.status == 200
        assert answer(f"{at.scheme}://{at.netloc}/{'a' * 70_000}")[0] == 414
        cookie = {"Cookie": "; ".join(f"c{k}=1" for k in range(5000))}
        assert answer(address.partition("?")[0], **cookie)[0] in (403, 431)
    with pytest.raises(OSError, match="refused"):
        socket.create_connection((HOST, at.port)).close()
    for line in frozen[1::2]:
        line.close()


def test_silent_client_is_disconnected(monkeypatch):
    """A client that sends nothing is disconnected after the timeout, which is well below a minute."""
    assert module._Handler.timeout < 30
    monkeypatch.setattr(module._Handler, "timeout", 0.05)
    with serving(ROUTES) as address, socket.create_connection((HOST, urlsplit(address).port), 20) as line:
        assert line.recv(1) == b""
