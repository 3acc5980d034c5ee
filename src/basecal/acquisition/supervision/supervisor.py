"""The supervisor: a process that starts one process for each arm, and stops all arms together.

The supervisor imports only the standard library and computes nothing, so that nothing delays it. It stops all arms if
one of them reports trouble, hangs or ends, and if the capture ends or hangs while an arm moves. It also stops them on
SIGINT, SIGTERM and SIGHUP of the capture; the system writes the signal numbers into a pipe. After a stop, no request is
forwarded to an arm.
"""

from __future__ import annotations

import json
import os
import pickle
import selectors
import signal
import subprocess
import sys
import time
from contextlib import suppress
from dataclasses import dataclass

from basecal.acquisition.supervision.frames import Channel, Frame, Kind
from basecal.acquisition.supervision.limits import (
    CLOSE_S,
    FORCED_END_S,
    HANG_LIMIT_S,
    HEARTBEAT_S,
    PARENT_HANG_LIMIT_S,
    REST_HANG_LIMIT_S,
    STALE_S,
    STOP_S,
    TICK_S,
)
from basecal.acquisition.supervision.standstill import Standstill, standstill_reason

_ARM_COMMAND = [sys.executable, "-m", "basecal.acquisition.supervision.arm_process"]
_ENDING_SIGNALS = {signal.SIGINT: "Ctrl-C", signal.SIGTERM: "SIGTERM", signal.SIGHUP: "SIGHUP"}
_FORWARDED_KINDS = (Kind.OPENED, Kind.FAILED, Kind.ANSWER, Kind.READING)
_WARNING_FILTER = "ignore"  # warnings of drivers' libraries


@dataclass(eq=False)
class _Arm:
    """The process of an arm."""

    number: int
    name: str
    process: subprocess.Popen[bytes]
    channel: Channel
    heard_s: float
    read_s: float | None = None
    is_open: bool = False
    stops_if_killed: bool = True
    is_moving: bool = False
    has_stopped: bool = False
    is_gone: bool = False

    @classmethod
    def start(cls, number: int, name: str) -> _Arm:
        """Start the process of an arm."""
        process = subprocess.Popen(
            _ARM_COMMAND,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env={**os.environ, "PYTHONWARNINGS": _WARNING_FILTER},
        )
        assert process.stdin is not None
        assert process.stdout is not None
        channel = Channel(process.stdout.fileno(), process.stdin.fileno())
        return cls(number, name, process, channel, time.monotonic())


class Supervisor:
    """Supervisor of all arms of a capture, and of the capture itself."""

    def __init__(self, parent: Channel, signals_fd: int, names: list[str]) -> None:
        self._parent, self._signals_fd, self._parent_pid = parent, signals_fd, os.getppid()
        self._arms = [_Arm.start(number, name) for number, name in enumerate(names)]
        now = time.monotonic()
        self._parent_heard_s = self._heartbeat_s = now
        self._standstill = Standstill()
        self._stopped_s: float | None = None
        self._closed_s: float | None = None
        self._forced_s: float | None = None
        self._reason, self._signals = "", 0
        self._is_reported = self._has_parent_ended = False
        self._ready = selectors.DefaultSelector()
        for fd in (parent.read_fd, signals_fd, *(arm.channel.read_fd for arm in self._arms)):
            self._ready.register(fd, selectors.EVENT_READ)

    def run(self) -> None:
        """Supervise until all arms are closed."""
        while self._closed_s is None or not all(arm.is_gone for arm in self._arms):
            self._ready.select(TICK_S)
            self._check_standstill()
            self._receive_signals()
            self._receive_from_parent()
            for arm in self._arms:
                self._receive_from_arm(arm)
            self._check_timeouts(time.monotonic())

    def stop(self, reason: str) -> None:
        """Stop all arms; only the first call's reason is reported."""
        if self._stopped_s is not None:
            return
        self._stopped_s, self._reason = time.monotonic(), reason
        for arm in self._arms:
            arm.channel.send(Kind.STOP)

    def close(self) -> None:
        """Close all arms."""
        if self._closed_s is None:
            self._closed_s = time.monotonic()
            for arm in self._arms:
                arm.channel.send(Kind.CLOSE)

    def _check_standstill(self) -> None:
        """Stop all arms if this process did not run for longer than it may be silent."""
        limit_s = HANG_LIMIT_S if any(arm.is_moving for arm in self._arms) else REST_HANG_LIMIT_S
        if (duration_s := self._standstill.duration_s) > limit_s:
            self.stop(standstill_reason("the process that supervises the arms", duration_s))
        self._standstill.end_cycle()

    def _receive_signals(self) -> None:
        with suppress(OSError):
            for number in os.read(self._signals_fd, 64):
                if number in _ENDING_SIGNALS:
                    self._signals += 1
                    if self._signals == 2:
                        self._forced_s = time.monotonic()
                    self.stop(_ENDING_SIGNALS[signal.Signals(number)])

    def _receive_from_parent(self) -> None:
        try:
            for frame in self._parent.receive():
                self._parent_heard_s = time.monotonic()
                self._handle_command(frame)
        except EOFError:
            if not self._has_parent_ended:
                self._has_parent_ended = True
                self._ready.unregister(self._parent.read_fd)
                self.stop("the capture ended without closing the arms")
                self.close()

    def _handle_command(self, frame: Frame) -> None:
        if frame.kind == Kind.STOP:
            self.stop(frame.payload.decode())
        elif frame.kind == Kind.CLOSE:
            self.close()
        elif frame.kind == Kind.OPEN or (frame.kind == Kind.REQUEST and self._stopped_s is None):
            self._arms[frame.arm].channel.send(Kind(frame.kind), frame.payload)

    def _receive_from_arm(self, arm: _Arm) -> None:
        if arm.is_gone:
            return
        try:
            for frame in arm.channel.receive():
                arm.heard_s = time.monotonic()
                self._handle_report(arm, frame)
        except EOFError:
            self._drop(arm)
            if self._closed_s is None:
                code = arm.process.wait()
                cause = f"signal {-code}" if code < 0 else f"exit code {code}"
                self.stop(f"{arm.name}: the process of its driver ended ({cause})")

    def _drop(self, arm: _Arm) -> None:
        """Kill the process of an arm; the watchdog of its controller stops the arm."""
        if not arm.is_gone:
            arm.is_gone = True
            self._ready.unregister(arm.channel.read_fd)
            with suppress(OSError):
                arm.process.kill()

    def _handle_report(self, arm: _Arm, frame: Frame) -> None:
        is_outdated = frame.kind == Kind.READING and self._parent.has_unsent  # newer states come once the capture reads
        if frame.kind in _FORWARDED_KINDS and not is_outdated:
            self._parent.send(Kind(frame.kind), frame.payload, arm.number)
        if frame.kind == Kind.OPENED:
            arm.is_open, arm.stops_if_killed = True, pickle.loads(frame.payload)["stops_if_killed"]
        elif frame.kind == Kind.ALIVE:
            arm.is_moving = bool(frame.payload[0])
        elif frame.kind == Kind.READING:
            arm.read_s = arm.heard_s
        elif frame.kind == Kind.TROUBLE:
            self.stop(frame.payload.decode())
        elif frame.kind == Kind.STOPPED:
            arm.has_stopped = True

    def _check_timeouts(self, now_s: float) -> None:
        is_moving = any(arm.is_moving for arm in self._arms)
        for arm in self._arms:
            arm.channel.flush()
            if (
                arm.is_open
                and not arm.is_gone
                and now_s - arm.heard_s > (HANG_LIMIT_S if is_moving else REST_HANG_LIMIT_S)
            ):
                self.stop(f"{arm.name}: its driver hangs")
            if is_moving and arm.read_s is not None and now_s - arm.read_s > STALE_S:
                self.stop(f"{arm.name}: no state came for {STALE_S:g} s while an arm moved: its link is lost")
        if is_moving and now_s - self._parent_heard_s > PARENT_HANG_LIMIT_S:
            self.stop("the capture hangs while an arm moves")
        if now_s - self._heartbeat_s > HEARTBEAT_S:
            self._heartbeat_s = now_s
            for channel in (self._parent, *(arm.channel for arm in self._arms)):
                channel.send(Kind.ALIVE)
        self._report(now_s)
        self._enforce_end(now_s)

    def _report(self, now_s: float) -> None:
        """Report a stop to the capture, once all arms confirmed it or the timeout is over.

        Without a watchdog, the process of an arm that did not confirm may still stop it, and is closed with the others.
        """
        if self._stopped_s is None or self._is_reported:
            return
        waiting = [arm for arm in self._arms if not (arm.has_stopped or arm.is_gone)]
        if waiting and now_s - self._stopped_s < STOP_S:
            return
        for arm in waiting:
            if arm.stops_if_killed:
                self._drop(arm)
        unconfirmed = [arm.name for arm in self._arms if not arm.has_stopped]
        event = {
            "reason": self._reason,
            "unconfirmed": unconfirmed,
            "by_signal": self._reason in _ENDING_SIGNALS.values(),
        }
        self._parent.send(Kind.EVENT, json.dumps(event).encode())
        self._is_reported = True

    def _enforce_end(self, now_s: float) -> None:
        if self._forced_s is not None and now_s - self._forced_s > FORCED_END_S and not self._has_parent_ended:
            with suppress(OSError):
                os.kill(self._parent_pid, signal.SIGKILL)
        if self._closed_s is not None and now_s - self._closed_s > CLOSE_S:
            for arm in self._arms:
                self._drop(arm)


def main() -> None:
    """Supervise arms; the command line has the file descriptor of the signal pipe, and the names of the arms."""
    for number in _ENDING_SIGNALS:
        signal.signal(number, signal.SIG_IGN)
    signals_fd = int(sys.argv[1])
    os.set_blocking(signals_fd, False)
    supervisor = Supervisor(Channel(0, 1), signals_fd, sys.argv[2:])
    try:
        supervisor.run()
    finally:
        supervisor.stop("the supervisor failed")
        supervisor.close()


if __name__ == "__main__":
    main()
