"""Who may see a local page."""

from __future__ import annotations

import pytest

from basecal.reporting.live.guard import Guard

HOST = "127.0.0.1:5000"
COOKIE = {"cookie": "x=1; basecal_5000=secret"}
GUARD = Guard("secret", (HOST,))


def is_answered(method="GET", token=None, **headers):
    query = {} if token is None else {"token": token}
    return not GUARD.refusal_reason(method, query, {"host": HOST, **headers})


def test_the_token_opens():
    """In the address or the cookie; a request that names the page itself as its origin is answered."""
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
def test_all_else_is_refused(given):
    """A missing or wrong token, another name, another page."""
    assert not is_answered(**given)
    assert not is_answered("POST", **{**given, "origin": given.get("origin", f"http://{HOST}")})


def test_what_changes_something_needs_cookie_and_origin():
    """The address alone, which others may read, stops nothing; neither does a form of another page."""
    own = {"origin": f"http://{HOST}"}
    assert is_answered("POST", **COOKIE, **own)
    assert not is_answered("POST", **COOKIE)
    assert not is_answered("POST", token="secret", **own)
    assert not is_answered("POST", **COOKIE, origin="http://evil.example")
