"""A base class for drivers of robots that re-establishes a lost connection."""

from __future__ import annotations

import socket
import time
from abc import ABC, abstractmethod
from contextlib import suppress

import numpy as np

from basecal.acquisition.driver import Reading, check_reading
from basecal.acquisition.freshness import STALE_S, Stale, Waits, wait_for_newer
from basecal.errors import BasecalError, DriverError, count_text

_RETRY_S = 0.2  # between two attempts to connect
_CONNECT_S = 3.0  # timeout: a controller in the same building answers within milliseconds, a booting one never


class LostLink(DriverError):
    """The connection is lost, and may be re-established."""


class ReconnectingRobot(ABC):
    """A robot whose connection is re-established after a loss.

    A subclass implements `connect`, `read` and `disconnect` of one connection; a single thread calls them. Each method
    must have a timeout of at most one second. `LostLink`, and any error that is not a `BasecalError`, means that the
    connection is lost. Every other `BasecalError` ends the capture at once.

    Attributes:
        is_connected: Whether there is a connection.
        repeats_stamps: Whether an unchanged state keeps its timestamp; set it in the subclass.
    """

    is_live = True
    repeats_stamps = False

    def __init__(self, name: str, reconnect_s: float = 10.0, rate_hz: float = 125.0) -> None:
        """Connect.

        Args:
            name: Name of the robot, for messages.
            reconnect_s: Timeout for re-establishing a lost connection [s].
            rate_hz: Highest rate of calls to `read` [Hz].
        """
        self.name, self._reconnect_s, self._period_s = name, reconnect_s, 1 / rate_hz
        self._waits, self._next_s, self._stale_count = Waits(name), 0.0, 0
        self._last: Reading | None = None
        self.is_connected = False
        try:
            self._connect()
        except Exception as error:
            raise _as_basecal_error(name, error, is_first=True) from error

    @abstractmethod
    def connect(self) -> None:
        """Establish a connection."""

    @abstractmethod
    def read(self) -> Reading | None:
        """Read the newest state; None if no state has arrived yet."""

    def disconnect(self) -> None:
        """Release the connection, whether it is intact or lost."""
        return

    def state(self) -> Reading:
        """Return the robot's next state, newer than the last one; reconnect if necessary.

        Raises:
            DriverError: if no state arrives before the timeout; if timestamps do not advance; if states are implausible
                or their rate is too low.
        """
        began_s = time.monotonic()
        deadline_s = began_s + STALE_S + self._reconnect_s
        self._stale_count = 0
        while True:
            try:
                self._reconnect()
                reading = wait_for_newer(self._read_newer)
                break
            except Exception as error:
                self._lose(error, deadline_s)
        self._waits.add(time.monotonic() - began_s)
        self._last = reading
        return reading

    def close(self) -> None:
        """Close the connection."""
        if self.is_connected:
            self.is_connected = False
            with suppress(Exception):  # errors of a connection that is given up
                self.disconnect()

    def _connect(self) -> None:
        self.connect()
        self.is_connected = True

    def _reconnect(self) -> None:
        """Connect if there is no connection; a refusal counts as a lost link, because the controller may be booting."""
        try:
            if not self.is_connected:
                self._connect()
        except DriverError as error:
            raise LostLink(str(error)) from error

    def _read_newer(self) -> Reading | None:
        time.sleep(max(0.0, self._next_s - time.monotonic()))
        self._next_s = time.monotonic() + self._period_s
        reading = self.read()
        if reading is None:
            return None
        check_reading(self.name, reading)
        if self._last is None or reading.stamp_s > self._last.stamp_s:
            return reading
        if self.repeats_stamps and reading.stamp_s == self._last.stamp_s and _is_same(reading, self._last):
            return reading
        self._stale_count += 1
        return None

    def _lose(self, error: Exception, deadline_s: float) -> None:
        """Close the connection; raise the error if it is final or the deadline [s] has passed."""
        if isinstance(error, BasecalError) and not isinstance(error, LostLink):
            raise error
        self.close()
        if time.monotonic() > deadline_s:
            raise DriverError(self._reason(error)) from None
        time.sleep(_RETRY_S)

    def _reason(self, error: Exception) -> str:
        if self._stale_count and self._last is not None:
            return (
                f"{self.name}: stale stamps: {count_text(self._stale_count, 'state')} came, none with a stamp newer "
                f"than {self._last.stamp_s:.3f} s. The clock of the controller stands still or went back, or it sends "
                f"old states. Restart it"
            )
        return f"{_as_basecal_error(self.name, error)}; tried again for {self._reconnect_s:g} s"


def _is_same(reading: Reading, last: Reading) -> bool:
    return np.array_equal(reading.state.vector, last.state.vector)


def _as_basecal_error(name: str, error: Exception, is_first: bool = False) -> BasecalError:
    if isinstance(error, BasecalError):
        return error
    if isinstance(error, Stale):
        return DriverError(f"{name}: no state came. Is the controller on, and the network plugged in?")
    words = " ".join(f"{type(error).__name__} {error}".split())
    if is_first:
        return DriverError(f"{name}: no connection ({words}). Is it on, and are its options in cell.yaml right?")
    return DriverError(f"{name}: its connection was lost ({words})")


def connect(name: str, host: str, port: int, device: str) -> socket.socket:
    """Open a TCP connection with a timeout of three seconds for the connection and for reads.

    Args:
        name: Name of the robot or camera, for messages.
        host: Host name or IP address.
        port: TCP port.
        device: Expected device, for messages.

    Raises:
        DriverError: if the host is unknown or does not answer, or nothing listens at the port.
    """
    try:
        return socket.create_connection((host, port), timeout=_CONNECT_S)
    except socket.gaierror:
        problem = f"there is no host {host!r}: look at its address in cell.yaml"
    except ConnectionRefusedError:
        problem = f"nothing listens at {host}:{port}: is {device} running there, and is the port right?"
    except PermissionError:
        problem = (
            f"this computer is not allowed to connect to {host}:{port}: a firewall or a rule of the system forbids it"
        )
    except OSError:
        problem = f"{host}:{port} is not reachable: is it on, and in the same network?"
    raise DriverError(f"{name}: {problem}")
