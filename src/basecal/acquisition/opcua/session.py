"""A session with an OPC UA server: values of nodes with their stamps; one that is lost is begun again."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Sequence
from concurrent.futures import CancelledError
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np

from basecal.acquisition.opcua.options import OpcuaOptions
from basecal.acquisition.reach import reached
from basecal.errors import DriverError, MissingExtra
from basecal.geometry import Array

_TRY_AGAIN_S = 0.2  # between two attempts to connect
_ANSWER_S = 4.0  # a server has for an answer; some sign on slowly
_GONE = ("Connection", "Session", "SecureChannel", "Timeout", "Shutdown", "ServerHalted")
_REFUSED = ("UserAccessDenied", "IdentityToken", "SecurityPolicy", "SecurityMode", "SecurityChecks", "Unauthorized")


Given = TypeVar("Given")


@dataclass(frozen=True, eq=False)
class Values:
    """What was read at once: `numbers` (k,), and the time at which the latest of them was taken [s]."""

    stamp_s: float
    numbers: Array


class Session:
    """Nodes of a server, read again and again."""

    def __init__(self, name: str, options: OpcuaOptions, nodes: Callable[[Any], Sequence[Any]]) -> None:
        self._name, self._options, self._find = name, options, nodes
        self._begin()

    def _begin(self) -> None:
        options = self._options
        try:
            from asyncua.sync import Client
        except ImportError:
            raise MissingExtra("opcua", "the driver 'opcua'") from None
        reached(self._name, options.host, options.port, "an OPC UA server").close()
        client = Client(options.url, timeout=_ANSWER_S)
        if options.user is not None:
            client.set_user(options.user)
            client.set_password(os.environ.get(options.password_in or "", ""))
        try:
            _answered(self._name, client.connect)
        except DriverError:
            client.tloop.stop()
            raise
        self._client = client
        try:
            self.nodes = list(_answered(self._name, lambda: self._find(self._client)))
        except BaseException:
            self.close()
            raise

    def read(self) -> Values:
        """Values now.

        Raises:
            DriverError: if the server has none of a node, or does not answer though it was tried again.
        """
        until_s = time.monotonic() + self._options.reconnect_s
        while True:
            try:
                return self._values(_answered(self._name, lambda: self._client.read_attributes(self.nodes)))
            except _Lost as error:
                self._again(until_s, str(error))

    def _again(self, until_s: float, why: str) -> None:
        self.close()
        while True:
            try:
                self._begin()
                return
            except DriverError as error:
                if time.monotonic() > until_s:
                    raise DriverError(f"{error}; {why}; tried again for {self._options.reconnect_s:g} s") from None
            time.sleep(_TRY_AGAIN_S)

    def _values(self, given: Sequence[Any]) -> Values:
        for node, each in zip(self.nodes, given, strict=True):
            if not each.StatusCode.is_good() or each.Value is None:
                raise DriverError(f"{self._name}: the server has no value of {node}: {each.StatusCode.name}")
        numbers = np.concatenate([np.atleast_1d(np.asarray(each.Value.Value, dtype=float)) for each in given])
        if not np.all(np.isfinite(numbers)):
            raise DriverError(f"{self._name}: the server gives numbers that are not finite; look at {self.nodes[0]}")
        stamps = [each.SourceTimestamp or each.ServerTimestamp for each in given]
        known = [stamp.timestamp() for stamp in stamps if stamp is not None]
        return Values(max(known) if known else time.time(), numbers)

    def close(self) -> None:
        """Sign off."""
        with suppress(Exception):  # whatever it is, the session is given up
            self._client.disconnect()


class _Lost(DriverError):
    """The session is gone; it may be begun again."""


def _answered(name: str, ask: Callable[[], Given]) -> Given:
    """What the server answers.

    Raises:
        _Lost: if the connection or the session is gone.
        DriverError: if it does not allow it, or what is asked for is not there.
    """
    from asyncua.ua.uaerrors import UaError

    try:
        return ask()
    except UaError as error:
        said = type(error).__name__ + (f", {' '.join(str(error).split())}" if str(error) else "")
        if any(word in said for word in _REFUSED):
            why = "no permission: the server refuses this user or an unsigned connection; say `user` and `password_in`"
            raise DriverError(f"{name}: {why} ({said})") from None
        kind = _Lost if any(word in said for word in _GONE) else DriverError
        raise kind(f"{name}: the server says {said}") from None
    except (OSError, TimeoutError, CancelledError) as error:
        raise _Lost(f"{name}: the server does not answer ({type(error).__name__})") from None
