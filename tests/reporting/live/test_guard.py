"""Tests of the access control of a local page."""

from __future__ import annotations

import pytest

from basecal.reporting.live.guard import Guard

HOST = "127.0.0.1:5000"
COOKIE = {"cookie": "x=1; basecal_5000=secret"}
GUARD = Guard("secret", (HOST,))


def is_answered(method="GET", token=None, **headers):
    query = {} if token is None else {"token": token}
    return not GUARD.refusal_reason(method, query, {"host": HOST, **headers})


def test_token_grants_access():
    """The token is in the address or the cookie. A request with the page itself as its origin is answered."""
    assert is_answered(token="secret")
    assert is_answered(**COOKIE)
    assert is_answered(token="secret", origin=f"http://{HOST}")


@pytest.mark.parametrize(
    "given",
    [
        {},
        {"token": "secre"},
        {"token": ""},
        {"cookie": "basecal_5000=other"},
        {"cookie": "basecal_5001=secret"},
        {"cookie": "=;=;"},
        {"token": "secret", "host": "evil.example"},
        {"token": "secret", "origin": "http://evil.example"},
        {"token": "secret", "origin": "null"},
    ],
)
def test_invalid_requests_are_refused(given):
    """A missing or wrong token, another host, or another origin is refused."""
    assert not is_answered(**given)
    assert not is_answered("POST", **{**given, "origin": given.get("origin", f"http://{HOST}")})


def test_post_requires_cookie_and_origin():
    """The token in the address, which others may read, does not suffice for a POST, nor does a form of another page."""
    own = {"origin": f"http://{HOST}"}
    assert is_answered("POST", **COOKIE, **own)
    assert not is_answered("POST", **COOKIE)
    assert not is_answered("POST", token="secret", **own)
    assert not is_answered("POST", **COOKIE, origin="http://evil.example")
