"""Access control of a local page: requests need its token, and a POST must come from the page itself."""

from __future__ import annotations

import hmac
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from http.cookies import CookieError, SimpleCookie


@dataclass(frozen=True)
class Guard:
    """Decides which requests are answered.

    Attributes:
        token: Secret in the printed address.
        hosts: Host names of the page, each with its port.
    """

    token: str
    hosts: Collection[str]

    @property
    def cookie(self) -> str:
        """Name of the cookie, with the port, since browsers share cookies between the ports of a host."""
        return f"basecal_{min(self.hosts).rpartition(':')[2]}"

    def refusal_reason(self, method: str, query: Mapping[str, str], headers: Mapping[str, str]) -> str:
        """Why a request is refused; empty if it is answered.

        A POST changes state: it needs the cookie, which is in no address, and the page's own origin.

        Args:
            method: `GET` or `POST`.
            query: Parameters of the address.
            headers: Headers by name in lower case.
        """
        if headers.get("host") not in self.hosts:
            return "the request uses another host name than the page's"
        origin = headers.get("origin")
        if (method == "POST" or origin is not None) and (origin or "").partition("://")[2] not in self.hosts:
            return "the request is from another page"
        given = [_cookie(headers.get("cookie", ""), self.cookie)]
        given += [] if method == "POST" else [query.get("token", "")]
        if not any(hmac.compare_digest(each.encode(), self.token.encode()) for each in given):
            return "the token is missing or wrong: open the address that was printed"
        return ""


def _cookie(header: str, name: str) -> str:
    try:
        morsel = SimpleCookie(header).get(name)
    except CookieError:
        return ""
    return "" if morsel is None else morsel.value
