"""A session with an OPC UA server: values of nodes with their timestamps."""

from __future__ import annotations

import logging
import os
import time
from collections.abc import Callable, Sequence
from concurrent.futures import CancelledError
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np

from basecal.acquisition.links.reconnecting import LostLink, connect
from basecal.acquisition.opcua.options import OpcuaOptions
from basecal.errors import DriverError, MissingExtra
from basecal.geometry import Array

_ANSWER_S = 4.0  # timeout of requests; the login to some servers is slow
_LIBRARIES = ("asyncua", "asyncio")
_LOST_WORDS = ("Connection", "Session", "SecureChannel", "Timeout", "Shutdown", "ServerHalted")
_UTC_S = time.time() - time.monotonic()  # a step of this computer's clock makes no state older than the last one
_REFUSAL_WORDS = (
    "UserAccessDenied",
    "IdentityToken",
    "SecurityPolicy",
    "SecurityMode",
    "SecurityChecks",
    "Unauthorized",
)


Reply = TypeVar("Reply")


@dataclass(frozen=True, eq=False)
class Values:
    """Values from one read: `numbers` (k,), and the newest of their timestamps [s]."""

    stamp_s: float
    numbers: Array


class Session:
    """A session that reads nodes of a server."""

    def __init__(
        self,
        name: str,
        options: OpcuaOptions,
        find_nodes: Callable[[Any], Sequence[Any]],
        allow_plaintext: bool = False,
    ) -> None:
        self._name, self._options, self._find_nodes = name, options, find_nodes
        try:
            from asyncua.sync import Client
        except ImportError:
            raise MissingExtra("opcua", "the driver 'opcua'") from None
        connect(self._name, options.host, options.port, "an OPC UA server").close()
        for library in _LIBRARIES:
            logging.getLogger(library).addHandler(logging.NullHandler())  # otherwise tracebacks go to stderr
        client = Client(options.url, timeout=_ANSWER_S)
        if options.user is not None:
            client.set_user(options.user)
            client.set_password(os.environ.get(options.password_in, ""))
            if not allow_plaintext:
                _forbid_plaintext(name, client.aio_obj)
        self._client = client
        try:
            _send_request(self._name, client.connect)
            self.nodes = list(_send_request(self._name, lambda: self._find_nodes(self._client)))
        except BaseException:
            self.close()
            raise

    def read(self) -> Values:
        """Read the current values of the nodes.

        Raises:
            LostLink: if the connection or the session is lost.
            DriverError: if the server has no value of a node.
        """
        return self._values(_send_request(self._name, lambda: self._client.read_attributes(self.nodes)))

    def _values(self, data_values: Sequence[Any]) -> Values:
        for node, each in zip(self.nodes, data_values, strict=True):
            if not each.StatusCode.is_good() or each.Value is None:
                raise DriverError(f"{self._name}: the server has no value of {node}: {each.StatusCode.name}")
        numbers = np.concatenate([np.atleast_1d(np.asarray(each.Value.Value, dtype=float)) for each in data_values])
        stamps = [each.SourceTimestamp or each.ServerTimestamp for each in data_values]
        known = [stamp.timestamp() for stamp in stamps if stamp is not None]
        return Values(max(known) if known else _UTC_S + time.monotonic(), numbers)

    def close(self) -> None:
        """Close the session."""
        with suppress(Exception):  # errors of a session that is given up
            self._client.disconnect()


def _forbid_plaintext(name: str, client: Any) -> None:
    """Make a client raise an error instead of sending a password without encryption."""
    from asyncua.crypto.security_policies import SecurityPolicyNone

    find_policy = client.server_policy

    def encrypting_policy(token_type: Any) -> Any:
        """The security policy with which the client encrypts the password."""
        policy = find_policy(token_type)
        if policy.SecurityPolicyUri in (None, "", SecurityPolicyNone.URI):
            problem = (
                "the server accepts the password only without encryption, and everybody in the network can read it"
            )
            raise DriverError(f"{name}: {problem}; to send it all the same, add --allow-plaintext")
        return policy

    client.server_policy = encrypting_policy


def _send_request(name: str, request: Callable[[], Reply]) -> Reply:
    """Send a request; the server's reply.

    Raises:
        LostLink: if the connection or the session is lost.
        DriverError: if the server refuses the request, or the requested node does not exist.
    """
    from asyncua.ua.uaerrors import UaError

    try:
        return request()
    except UaError as error:
        problem = type(error).__name__ + (f", {' '.join(str(error).split())}" if str(error) else "")
        if any(word in problem for word in _REFUSAL_WORDS):
            why = (
                "no permission: the server refuses this user or an unsigned connection; state `user` and `password_in`"
            )
            raise DriverError(f"{name}: {why} ({problem})") from None
        kind = LostLink if any(word in problem for word in _LOST_WORDS) else DriverError
        raise kind(f"{name}: the server says {problem}") from None
    except (OSError, TimeoutError, CancelledError) as error:
        raise LostLink(f"{name}: the server does not answer ({type(error).__name__})") from None
