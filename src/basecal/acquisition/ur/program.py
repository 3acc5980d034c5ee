"""The program of ur-rtde that runs on a UR controller during motions and freedrive, and its watchdog."""

from __future__ import annotations

import socket
import threading
from collections.abc import Callable
from contextlib import suppress
from typing import Any, TypeVar

from basecal.acquisition.links.reconnecting import connect
from basecal.acquisition.ur.options import UrOptions
from basecal.errors import DriverError, error_words

_DASHBOARD_PORT = 29999
_EXPECTED_DEVICES = {_DASHBOARD_PORT: "the dashboard of a UR", 30003: "a UR that takes programs"}
_WATCHDOG_HZ = 6.0  # URSim stops a program after about two periods of silence: a third of a second
_BUSY_TIMEOUT_S = 0.1  # for a stop to wait until another call releases the connection
_STOP_RAD_S2 = 2.0  # deceleration of each joint in a stop: from 30 deg/s it takes a quarter of a second
_DASHBOARD_TIMEOUT_S = 0.2  # for the dashboard to accept a command
_LONGEST_LINE = 256  # bytes of a line of the dashboard
_STOPPED = "Stopped"  # reply to `stop` if it succeeded; Source: Universal Robots, Dashboard Server e-Series

Reply = TypeVar("Reply")


class Program:
    """The program on the controller; it is sent at the first request, and not again after it ended."""

    def __init__(self, name: str, options: UrOptions) -> None:
        self._name, self._options = name, options
        self._interface: Any = None
        self._is_lost = False
        self._lock = threading.Lock()

    @property
    def was_sent(self) -> bool:
        """Whether the program was sent."""
        return self._interface is not None

    @property
    def is_connected(self) -> bool:
        """Whether the connection was never lost: after a loss, each call of ur-rtde would send its program again."""
        self._is_lost = self._is_lost or (self.was_sent and not self._interface.isConnected())
        return not self._is_lost

    def ask(self, request: Callable[[Any], Reply]) -> Reply:
        """Call ur-rtde's `RTDEControlInterface`, and start the program if necessary.

        Args:
            request: Function of the interface; its result is returned.

        Raises:
            DriverError: if the program cannot be started, or was stopped.
        """
        with self._lock:
            try:
                if self._interface is None:
                    self._interface = self._start()
                elif not (self.is_connected and self._interface.isProgramRunning()):
                    raise DriverError(
                        f"{self._name}: the program on the controller was stopped. It is not sent again automatically: "
                        f"find out who stopped it, then start again."
                    )
                return request(self._interface)
            except (RuntimeError, ValueError) as error:
                problem = error_words(error)
                if "remote control" in problem:
                    problem = "no permission to move: choose remote control on the pendant, then start again"
                raise DriverError(f"{self._name}: {problem}") from None

    def _start(self) -> Any:
        from rtde_control import RTDEControlInterface

        for port, device in _EXPECTED_DEVICES.items():
            connect(self._name, self._options.host, port, device).close()
        interface = RTDEControlInterface(self._options.host, self._options.rate_hz)
        if not interface.setWatchdog(_WATCHDOG_HZ):
            interface.stopScript()
            raise DriverError(f"{self._name}: the controller did not start its watchdog; look at the pendant's log")
        return interface

    def keep_alive(self) -> None:
        """Send a heartbeat to the watchdog, unless another call is in progress, which also counts as one.

        Raises:
            DriverError: if the connection to the controller is lost.
        """
        if self._interface is not None and self._lock.acquire(blocking=False):
            try:
                if not self.is_connected:
                    raise RuntimeError("End of file")
                self._interface.kickWatchdog()
            except (RuntimeError, ValueError) as error:
                raise DriverError(f"{self._name}: its connection was closed ({error_words(error)})") from None
            finally:
                self._lock.release()

    def stop(self, is_connected: bool = True) -> None:
        """Decelerate all joints; if the connection is lost or blocked, stop the program through the dashboard.

        Args:
            is_connected: Whether the controller is reachable by its other connection.

        Raises:
            DriverError: if the stop fails.
        """
        if not self.was_sent:
            return
        if is_connected and self.is_connected and self._lock.acquire(timeout=_BUSY_TIMEOUT_S):
            try:
                self._interface.stopJ(_STOP_RAD_S2, True)
            except (RuntimeError, ValueError) as error:
                raise DriverError(f"{self._name}: {error_words(error)}") from None
            finally:
                self._lock.release()
        else:
            self._stop_by_dashboard()

    def _stop_by_dashboard(self) -> None:
        address = self._options.host, _DASHBOARD_PORT
        try:
            with (
                socket.create_connection(address, timeout=_DASHBOARD_TIMEOUT_S) as connection,
                connection.makefile("rb") as lines,
            ):
                connection.sendall(b"stop\n")
                _, reply = lines.readline(_LONGEST_LINE), lines.readline(_LONGEST_LINE)  # the first line is a greeting
                answer = reply.decode(errors="replace").strip()
        except OSError as error:
            answer = str(error)
        if answer != _STOPPED:
            raise DriverError(f"{self._name}: its dashboard did not take the stop ({answer})")

    def close(self) -> None:
        """End the program on the controller, and close the connection."""
        if self._interface is not None:
            with suppress(RuntimeError), self._lock:
                if self.is_connected:
                    self._interface.stopScript()
                self._interface.disconnect()
