"""Proxies of arms whose drivers run in separate processes, and the connection to their supervisor."""

from __future__ import annotations

import json
import os
import pickle
import select
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import partial
from typing import Any

from basecal.acquisition.driver import Place, Reading, Robot
from basecal.acquisition.supervision.frames import Channel, Frame, Kind
from basecal.acquisition.supervision.limits import (
    CLOSE_S,
    HEARTBEAT_S,
    PARENT_HANG_LIMIT_S,
    REST_HANG_LIMIT_S,
    STALE_S,
    START_S,
    STOP_S,
    TICK_S,
)
from basecal.acquisition.supervision.signals import interrupt_main_thread
from basecal.acquisition.supervision.standstill import Standstill, standstill_reason
from basecal.cell import RobotState
from basecal.errors import DriverError

_SUPERVISOR_MODULE = "basecal.acquisition.supervision.supervisor"
_OPEN_TIMEOUT_S = 60.0  # for a driver to connect: it imports libraries, and drivers have their own timeouts
_ANSWER_TIMEOUT_S = 15.0  # for a request: the first one to a UR sends a program
_POLL_S = 0.1  # polling period of the flag that all arms were stopped


class Arms:
    """The supervisor of the arms of a capture, and proxies of these arms."""

    def __init__(self, places: Mapping[str, Place], signals_fd: int) -> None:
        """Start the supervisor and one process for each arm.

        Args:
            places: Place of each arm, by name.
            signals_fd: Read end of the pipe into which the system writes signal numbers.
        """
        self._names = list(places)
        self._open_timeouts_s = [_open_timeout_s(place) for place in places.values()]
        self._changed = threading.Condition()
        self._readings: dict[int, tuple[int, float, Reading]] = {}  # number, time of reading [s], latest state
        self._answers: dict[int, tuple[Any, Any]] = {}
        self._opened: dict[int, Any] = {}
        self._requests = 0
        self._reason = ""
        self._is_ending = self._is_interrupted = False
        self._unreported: list[str] = []  # arms that did not confirm a stop, not reported yet
        self._standstill, self._standstill_reason = Standstill(), ""
        command = [sys.executable, "-m", _SUPERVISOR_MODULE, str(signals_fd), *self._names]
        self._process = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            pass_fds=(signals_fd,),
            start_new_session=True,  # a terminal's Ctrl-C reaches only the capture
            env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
        )
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._pipes = self._process.stdin, self._process.stdout
        self._channel = Channel(self._process.stdout.fileno(), self._process.stdin.fileno())
        threading.Thread(target=self._listen, daemon=True).start()
        for number, place in enumerate(places.values()):
            self._channel.send(Kind.OPEN, pickle.dumps((place, sys.path)), number)

    @property
    def interruption(self) -> str:
        """The reason why all arms were stopped; empty if they were not, or the main thread is ending anyway."""
        return "" if self._is_ending else self._reason

    def stop_interrupting(self) -> None:
        """Disable interruptions of the main thread, which is about to close the arms."""
        self._is_ending = True

    def open_arms(self) -> dict[str, Robot]:
        """Wait until all drivers have opened their arms; proxies of the arms, by name.

        Raises:
            BasecalError: the error of the first driver that failed to open.
        """
        with self._changed:
            for number, (name, timeout_s) in enumerate(zip(self._names, self._open_timeouts_s, strict=True)):
                self._wait(partial(self._is_open, number), timeout_s, f"{name}: its driver did not open")
        return {name: _proxy(self, number, self._opened[number]) for number, name in enumerate(self._names)}

    def _is_open(self, arm: int) -> bool:
        for outcome in self._opened.values():
            if not isinstance(outcome, dict):
                raise _error(*outcome)
        return arm in self._opened

    def wait_for_newer(self, arm: int, count: int) -> tuple[int, Reading]:
        """Wait until an arm has sent more than `count` states; their number, and the latest state, which is recent.

        A motion must not begin from a state from before the link fell silent, or before this process stood still.

        Raises:
            DriverError: if all arms were stopped.
        """
        with self._changed:
            while True:
                self._check()
                number, read_s, reading = self._readings.get(arm, (count, 0.0, None))
                if reading is not None and number > count and time.monotonic() - read_s < STALE_S:
                    return number, reading
                self._changed.wait(_POLL_S)

    def ask(self, arm: int, method: str, *arguments: Any, timeout_s: float = _ANSWER_TIMEOUT_S) -> Any:
        """Call a method of an arm's driver, with a timeout [s]; its result.

        Raises:
            DriverError: if all arms were stopped, or the driver does not answer.
            BasecalError: the error that the driver raised.
        """
        with self._changed:
            self._check()
            self._requests += 1
            number = self._requests
        self._channel.send(Kind.REQUEST, pickle.dumps((number, method, arguments)), arm)
        with self._changed:
            event = f"{self._names[arm]}: its controller did not answer"
            self._wait(lambda: number in self._answers, timeout_s, event)
            result, error = self._answers.pop(number)
        if error is not None:
            raise _error(*error)
        return result

    def stop(self, arm: int, reason: str) -> None:
        """Stop all arms, and wait for their confirmation or a timeout; later requests are not forwarded to them.

        Raises:
            DriverError: if this arm did not confirm the stop, unless an earlier error reported that.
        """
        self._is_ending = True
        self.request_stop(self._note_standstill() or reason)
        with self._changed:
            is_known = self._changed.wait_for(lambda: bool(self._reason), 2 * STOP_S)
        if not is_known or self._names[arm] in self._unreported:
            raise DriverError(f"{self._names[arm]} did not confirm a stop: look at the arm")

    def request_stop(self, reason: str) -> None:
        """Request a stop of all arms from the supervisor, which also ends the capture with the reason; thread-safe."""
        self._channel.send(Kind.STOP, reason.encode())

    @property
    def standstill_report(self) -> str:
        """The report of a stop because this process did not run; else empty."""
        return self._reason if self._standstill_reason else ""

    def _note_standstill(self) -> str:
        """The reason of a stop if this process did not run for ten seconds until now; else empty."""
        if (duration_s := self._standstill.duration_s) < REST_HANG_LIMIT_S:
            return ""
        self._standstill_reason = standstill_reason("the capture", duration_s)
        return self._standstill_reason

    def close(self) -> None:
        """End the processes of all arms; kill the supervisor if it does not end before a timeout."""
        self._is_ending = True
        self._channel.send(Kind.CLOSE)
        try:
            self._process.wait(CLOSE_S + STOP_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        for pipe in self._pipes:
            with suppress(OSError):
                pipe.close()

    def _wait(self, is_done: Callable[[], bool], timeout_s: float, event: str) -> None:
        deadline_s = time.monotonic() + timeout_s
        while not is_done():
            self._check()
            if time.monotonic() > deadline_s:
                raise DriverError(f"{event} within {timeout_s:g} s")
            self._changed.wait(_POLL_S)

    def _check(self) -> None:
        """Check that no arm was stopped.

        Raises:
            KeyboardInterrupt: if a signal stopped all arms: an error of a cleanup would hide that of the signal.
            DriverError: if all arms were stopped for another reason.
        """
        if self._reason:
            raise KeyboardInterrupt(self._reason) if self._is_interrupted else DriverError(self._reason)

    def _listen(self) -> None:
        """Receive frames of the supervisor until it ends, and send heartbeats to it."""
        heartbeat_s = time.monotonic()
        heard_s = heartbeat_s + START_S
        while True:
            select.select([self._channel.read_fd], [], [], TICK_S)
            now = time.monotonic()
            if self._standstill.duration_s > PARENT_HANG_LIMIT_S:  # the supervisor may not have run, either
                heard_s = max(heard_s, now)
            if reason := self._note_standstill():
                self.request_stop(reason)
            self._standstill.end_cycle()
            try:
                frames = self._channel.receive()
                for frame in frames:
                    self._handle(frame)
                heard_s = now if frames else heard_s
                problem = "the process that supervises the arms hangs" if now - heard_s > PARENT_HANG_LIMIT_S else ""
            except EOFError:
                problem = "the process that supervises the arms ended"
            except Exception as error:  # such as of a class that only the driver's process finds
                problem = f"what a driver sent cannot be read ({type(error).__name__}: {error})"
            if problem:
                self._set_stop_reason(problem, self._names)
                self._process.kill()
                return
            if now - heartbeat_s > HEARTBEAT_S:
                heartbeat_s = now
                self._channel.send(Kind.ALIVE)
            self._channel.flush()

    def _handle(self, frame: Frame) -> None:
        if frame.kind == Kind.EVENT:
            event = json.loads(frame.payload)
            self._is_interrupted = event["by_signal"]  # the main thread receives the signal itself
            self._is_ending = self._is_ending or self._is_interrupted
            self._set_stop_reason(event["reason"], event["unconfirmed"])
        elif frame.kind != Kind.ALIVE:
            content = pickle.loads(frame.payload)
            with self._changed:
                if frame.kind == Kind.READING:
                    count, *_ = self._readings.get(frame.arm, (0,))
                    self._readings[frame.arm] = (count + 1, *content)
                elif frame.kind == Kind.ANSWER:
                    self._answers[content[0]] = content[1:]
                else:
                    self._opened[frame.arm] = content
                self._changed.notify_all()

    @property
    def _stoppable_names(self) -> list[str]:
        """Names of the open arms that this program can stop; others are only read."""
        opened = {number: each for number, each in self._opened.items() if isinstance(each, dict)}
        return [self._names[number] for number, each in sorted(opened.items()) if each["moves"] or each["freedrives"]]

    def _set_stop_reason(self, reason: str, unconfirmed_names: list[str]) -> None:
        """Store the reason why arms were stopped, and interrupt the main thread."""
        if self._reason:
            return
        with self._changed:
            self._reason = stop_report(reason, self._stoppable_names, unconfirmed_names)
            self._unreported = unconfirmed_names if self._is_ending else []
            self._changed.notify_all()
        if not self._is_ending:
            interrupt_main_thread()


def _open_timeout_s(place: Place) -> float:
    """Timeout for a driver to open; some wait for their topic as long as they would reconnect."""
    reconnect_s = place.options.get("reconnect_s", 0)
    return _OPEN_TIMEOUT_S + (reconnect_s if isinstance(reconnect_s, int | float) else 0)  # its process refuses others


def stop_report(reason: str, names: list[str], unconfirmed_names: list[str]) -> str:
    """Message with the reason of a stop, the arms that confirmed it, and what to do."""
    confirmed = [name for name in names if name not in unconfirmed_names]
    words = [f"{reason.rstrip('.')}."]
    words += [f"{' and '.join(confirmed)} confirmed the stop."] if confirmed else []
    if unconfirmed_names:
        words.append(f"{' and '.join(unconfirmed_names)} did not confirm a stop: look at the arm.")
    words += ["Find the cause, then start again; what was recorded is kept."]
    return " ".join(words)


def _error(kind: type[BaseException], words: str, attributes: dict[str, Any]) -> BaseException:
    """Restore a driver's error from its type, message and attributes."""
    error = kind.__new__(kind, words)
    vars(error).update(attributes)
    return error


class RemoteRobot:
    """Proxy of a robot whose driver runs in a separate process."""

    def __init__(self, arms: Arms, number: int, is_live: bool) -> None:
        self._arms, self._number, self.is_live = arms, number, is_live
        self._count = 0

    def state(self) -> Reading:
        """Wait for a state newer than the last returned one.

        Raises:
            DriverError: if all arms were stopped.
        """
        if not self.is_live:
            reading: Reading = self._arms.ask(self._number, "state", timeout_s=float("inf"))
            return reading
        self._count, reading = self._arms.wait_for_newer(self._number, self._count)
        return reading

    def close(self) -> None:
        """Do nothing: the supervisor closes all arms together."""


class _MovingProxy(RemoteRobot):
    def move(self, to: RobotState, speed_rad_s: float) -> None:
        """Start a motion to a goal."""
        self._arms.ask(self._number, "move", to, speed_rad_s)

    def stop(self) -> None:
        """Stop this arm and all others."""
        self._arms.stop(self._number, "an arm was ordered to stop")


class _FreedriveProxy(RemoteRobot):
    def freedrive(self, on: bool) -> None:
        """Switch freedrive on or off."""
        self._arms.ask(self._number, "freedrive", on)


class _GoalCheckProxy(RemoteRobot):
    def goal_refusal(self, to: RobotState) -> str:
        """The controller's reason to refuse a goal; empty if it accepts the goal."""
        return str(self._arms.ask(self._number, "goal_refusal", to))


_CAPABILITY_PROXIES = {"moves": _MovingProxy, "freedrives": _FreedriveProxy, "checks_goals": _GoalCheckProxy}


def _proxy(arms: Arms, number: int, capabilities: dict[str, bool]) -> Robot:
    """A proxy that implements exactly the protocols of the robot."""
    proxies = tuple(proxy for name, proxy in _CAPABILITY_PROXIES.items() if capabilities[name])
    robot: Robot = type("Remote", (*proxies, RemoteRobot), {})(arms, number, capabilities["is_live"])
    return robot
