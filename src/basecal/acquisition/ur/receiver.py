"""States of a UR controller with its own timestamps, over RTDE; a lost connection is re-established."""

from __future__ import annotations

import struct
import time
from contextlib import suppress
from typing import Any

import numpy as np

from basecal.acquisition.driver import Reading
from basecal.acquisition.freshness import STALE_S, Stale, Waits, wait_for_newer
from basecal.acquisition.links.reconnecting import connect
from basecal.acquisition.ur.options import UrOptions
from basecal.cell import RobotState
from basecal.errors import DriverError, MissingExtra, error_words
from basecal.exchange.controllers.registry import CONTROLLERS

_RTDE_PORT = 30004
_VERSION_REQUEST = struct.pack(">HBH", 5, 86, 2)  # requests version 2 of the protocol: size, kind "V", version
_ACCEPT_REPLY = struct.pack(">HBB", 4, 86, 1)
_VARIABLES = ["timestamp", "actual_q", "actual_TCP_pose", "robot_status_bits", "safety_status_bits"]
_RETRY_S = 0.2  # between two attempts to connect
_PROGRAM_MASK = 2  # mask of the bit "program running" in `robot_status_bits`
_SAFETY_STOPS = {
    9: "the controller reports a fault",
    8: "the controller reports a violation",
    6: "emergency stop of the robot",
    5: "emergency stop of the system",
    7: "emergency stop",
    2: "protective stop",
    4: "safeguard stop",
    3: "recovery mode",
    10: "stopped for safety",
}
"""Bits of `safety_status_bits` that forbid motion, the most specific first; bit 0 is normal mode, 1 reduced mode.

Source: Universal Robots, Real-Time Data Exchange Guide.
"""

_SAFEGUARD_BITS = (4, 10)  # bits of a safeguard stop, such as a released enabling device in manual mode


class Receiver:
    """Receiver of a controller's states."""

    def __init__(self, name: str, options: UrOptions, gives_joints: bool) -> None:
        self._name, self._options, self._gives_joints = name, options, gives_joints
        # A person who jogs an arm with the pendant releases the enabling device whenever the arm is at rest.
        self._tolerated = _SAFEGUARD_BITS if options.motion == "watch" else ()
        self._waits = Waits(name)
        self._interface = _open_receiver(name, options)
        self._last_s = -1.0

    def state(self) -> Reading:
        """Return the next state, with the controller's timestamp [s since its start]; reconnect if necessary.

        Raises:
            DriverError: if the controller is in a safety stop, or no state arrives before the timeout.
        """
        began_s = time.monotonic()
        deadline_s, has_reconnected = began_s + STALE_S + self._options.reconnect_s, False
        while True:
            try:
                reading = wait_for_newer(self._read_newer)
            except Stale:
                if has_reconnected and time.monotonic() > deadline_s:
                    raise DriverError(
                        f"{self._name}: its stamps do not advance from {self._last_s:.3f} s: the controller sends old "
                        f"states; restart it"
                    ) from None
                self._reconnect(deadline_s)
                began_s, has_reconnected = time.monotonic(), True
                continue
            self._waits.add(time.monotonic() - began_s)
            return reading

    def _read_newer(self) -> Reading | None:
        stamp_s = self._interface.getTimestamp()
        values = self._interface.getActualQ() if self._gives_joints else self._interface.getActualTCPPose()
        if stamp_s == self._last_s or stamp_s != self._interface.getTimestamp():
            return None  # no new state, or a new state arrived during the read
        self._check_safety()
        self._last_s = stamp_s
        numbers = np.array(values)
        state = RobotState(joints_rad=numbers) if self._gives_joints else RobotState(CONTROLLERS["ur"].read(numbers))
        return Reading(stamp_s, state)

    @property
    def is_connected(self) -> bool:
        """Whether the connection is open; False as soon as the controller or the network closes it."""
        return bool(self._interface.isConnected())

    @property
    def is_program_running(self) -> bool:
        """Whether a program runs on the controller according to the last state."""
        return bool(self._interface.getRobotStatus() & _PROGRAM_MASK)

    def _check_safety(self) -> None:
        bits = self._interface.getSafetyStatusBits()
        for bit, words in _SAFETY_STOPS.items():
            if bits >> bit & 1 and bit not in self._tolerated:
                raise DriverError(f"{self._name}: {words}. Release it at the pendant.")

    def _reconnect(self, deadline_s: float) -> None:
        """Re-establish the connection.

        Raises:
            DriverError: if the connection fails until the deadline [s].
        """
        self._waits.forget()
        self.close()
        while True:
            try:
                self._interface = _open_receiver(self._name, self._options)
                return
            except DriverError as error:
                if time.monotonic() > deadline_s:
                    raise DriverError(f"{error}; tried again for {self._options.reconnect_s:g} s") from None
            time.sleep(_RETRY_S)

    def close(self) -> None:
        """Close the connection."""
        with suppress(RuntimeError):
            self._interface.disconnect()


def _open_receiver(name: str, options: UrOptions) -> Any:
    try:
        from rtde_receive import RTDEReceiveInterface
    except ImportError:
        raise MissingExtra("ur", "the driver 'ur'") from None
    _check_protocol(name, options.host)
    try:
        return RTDEReceiveInterface(options.host, options.rate_hz, _VARIABLES)
    except (RuntimeError, ValueError) as error:
        raise DriverError(f"{name}: {error_words(error)}") from None


def _check_protocol(name: str, host: str) -> None:
    """Check the protocol version before ur-rtde connects, which would wait forever for another program."""
    with connect(name, host, _RTDE_PORT, "a UR controller") as connection:
        try:
            connection.sendall(_VERSION_REQUEST)
            reply = connection.recv(len(_ACCEPT_REPLY))
        except OSError:
            reply = b""
    where = f"{name}: what listens at {host}:{_RTDE_PORT}"
    if not reply:
        raise DriverError(f"{where} does not answer. Wait until the controller has started, or restart it")
    if reply != _ACCEPT_REPLY:
        raise DriverError(f"{where} does not speak RTDE 2; expected a UR, PolyScope 3.3 or later")
