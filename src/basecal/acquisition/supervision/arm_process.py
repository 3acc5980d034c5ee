"""The process of one arm: its driver, and threads that read states, send heartbeats to its watchdog, and stop it.

A call of a vendor's library may block forever. Therefore four threads make separate calls: states, requests, the
heartbeat of the controller's watchdog, and a stop. The main thread never calls the driver: it receives the supervisor's
frames, and monitors the arm's motion.
"""

from __future__ import annotations

import os
import pickle
import queue
import resource
import select
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from typing import Any

import numpy as np

from basecal.acquisition.driver import (
    GOAL_TOLERANCE_RAD,
    PATH_TOLERANCE_RAD,
    ChecksGoals,
    DriverKind,
    Freedrives,
    HasWatchdog,
    Moves,
    Place,
    Reading,
    Robot,
    check_reading,
    driver_failure,
    has_arrived,
    largest_path_deviation,
)
from basecal.acquisition.drivers.registry import driver_kind
from basecal.acquisition.supervision.frames import Channel, Frame, Kind
from basecal.acquisition.supervision.limits import (
    CLOSE_S,
    HANG_LIMIT_S,
    HEARTBEAT_S,
    HOLD_S,
    MOST_CLOCK_DRIFT,
    RECONNECT_S,
    REST_HANG_LIMIT_S,
    REST_STALE_MARGIN_S,
    STALE_S,
    STOP_S,
    TICK_S,
)
from basecal.acquisition.supervision.standstill import Standstill, standstill_reason
from basecal.cell import RobotState
from basecal.errors import BasecalError, DriverError
from basecal.geometry import Array

_HEARTBEAT_S = 0.02  # between heartbeats to the controller: a watchdog of 6 Hz may miss seven
_SETTLED_STATES = 10  # consecutive states at the goal after which an arm no longer counts as moving
_CHANGED_RAD_M = 1e-4  # smallest change of a moving arm: even the slowest one exceeds it in two seconds
_MEMORY_BYTES = 2**30  # limit of a driver's memory: a damaged packet can request any length
_CAPABILITIES = {"moves": Moves, "freedrives": Freedrives, "checks_goals": ChecksGoals}


class ArmProcess:
    """Server of one arm, until the supervisor closes the arm or ends."""

    def __init__(self, channel: Channel) -> None:
        self._channel = channel
        self._name = "robot"
        self._robot: Robot | None = None
        self._requests: queue.SimpleQueue[tuple[int, str, tuple[Any, ...]]] = queue.SimpleQueue()
        self._goal: RobotState | None = None
        self._states_at_goal, self._is_in_freedrive = 0, False
        now = time.monotonic()
        self._read_s = self._changed_s = self._supervisor_s = self._heartbeat_s = now
        self._least_lag_s, self._least_lag_read_s = float("inf"), now
        self._values: Array | None = None
        self._path: tuple[Array | None, Array | None] = None, None
        # For goal and path: an arrival must not end a motion that starts at the same time.
        self._motion_lock = threading.Lock()
        self._must_stop = self._is_over = False
        self._stop_thread: threading.Thread | None = None
        self._patience_s = REST_STALE_MARGIN_S + RECONNECT_S
        self._standstill = Standstill()

    def run(self) -> None:
        """Execute the supervisor's commands until it closes this arm; stop the arm if the supervisor ends or hangs."""
        while not self._is_over:
            select.select([self._channel.read_fd], [], [], TICK_S)
            self._check_standstill()
            try:
                for frame in self._channel.receive():
                    self._supervisor_s = time.monotonic()
                    self._handle(frame)
            except EOFError:
                self._end()
            self._check_timeouts(time.monotonic())
            self._channel.flush()

    def _handle(self, frame: Frame) -> None:
        if frame.kind == Kind.OPEN:
            _start_thread(self._open, frame.payload)
        elif frame.kind == Kind.REQUEST:
            self._requests.put(pickle.loads(frame.payload))
        elif frame.kind == Kind.STOP:
            self._stop()
        elif frame.kind == Kind.CLOSE:
            self._end()

    def _check_standstill(self) -> None:
        """Stop if this process did not run for longer than it may be silent."""
        if self._stood_still and self._robot is not None and not self._must_stop:
            self._report("")
        self._standstill.end_cycle()

    @property
    def _stood_still(self) -> bool:
        """Whether this process did not run for longer than it may be silent."""
        limit_s = HANG_LIMIT_S if self._is_moving else min(REST_HANG_LIMIT_S, self._patience_s)
        return self._standstill.duration_s > limit_s

    def _check_timeouts(self, now_s: float) -> None:
        if now_s - self._heartbeat_s > HEARTBEAT_S:
            self._heartbeat_s = now_s
            self._channel.send(Kind.ALIVE, bytes([self._is_moving]))
        if self._robot is None or self._must_stop:
            return
        if self._is_moving and not getattr(self._robot, "is_connected", True):
            self._report(f"{self._name}: its connection was closed while it moved")
        if self._goal is not None and now_s - self._changed_s > HOLD_S:
            self._report(
                f"{self._name}: it is at rest, but not at its goal. Look for an obstacle, a paused program "
                f"or a speed slider at zero"
            )
        if self._robot.is_live and now_s - self._read_s > self._patience_s:
            self._report(f"{self._name}: no state came for {self._patience_s:g} s: its link is lost")
        if self._is_moving and now_s - self._supervisor_s > HANG_LIMIT_S:
            self._report(f"the process that supervises the arms was silent for {HANG_LIMIT_S:g} s, while they moved")

    @property
    def _is_moving(self) -> bool:
        """Whether the arm has a goal that it has not reached, or is in freedrive."""
        return self._goal is not None or self._is_in_freedrive

    def _report(self, reason: str) -> None:
        """Report trouble to the supervisor, which stops all arms, and stop this arm.

        Silence and late states have no other reason if this process did not run.
        """
        if self._stood_still:
            reason = standstill_reason(f"{self._name}: the process of its driver", self._standstill.duration_s)
        self._channel.send(Kind.TROUBLE, reason.encode())
        self._stop()

    def _open(self, payload: bytes) -> None:
        place, sys.path[:] = pickle.loads(payload)
        self._name = place.name
        try:
            kind = _find_driver(place)
            robot = _open_robot(kind, place)
            self._patience_s = REST_STALE_MARGIN_S + float(place.options.get("reconnect_s", RECONNECT_S))
            capabilities = {name: isinstance(robot, protocol) for name, protocol in _CAPABILITIES.items()}
            properties = {"is_live": robot.is_live, "stops_if_killed": kind.stop_guarantee != "none", **capabilities}
            self._channel.send(Kind.OPENED, pickle.dumps(properties))
        except BaseException as error:
            self._channel.send(Kind.FAILED, pickle.dumps(_error_data(self._name, error)))
            return
        self._read_s, self._robot = time.monotonic(), robot
        _start_thread(self._serve_requests, robot)
        if robot.is_live:
            _start_thread(self._read, robot, place)
        if isinstance(robot, HasWatchdog):
            _start_thread(self._send_heartbeats, robot)

    def _read(self, robot: Robot, place: Place) -> None:
        try:
            while not self._is_over:
                reading = robot.state()
                check_reading(self._name, reading)
                place.check_joints(reading.state)
                self._read_s = time.monotonic()
                self._check_lag(reading)
                self._note(reading)
                self._channel.send(Kind.READING, pickle.dumps((self._read_s, reading)))
        except BaseException as error:
            self._report(_error_text(self._name, error))

    def _check_lag(self, reading: Reading) -> None:
        """Check the delay of a state: on a slow link, timestamps fall behind this machine's clock.

        Raises:
            DriverError: if the state is late while the arm moves.
        """
        lag_s = self._read_s - reading.stamp_s
        late_s = lag_s - self._least_lag_s - MOST_CLOCK_DRIFT * (self._read_s - self._least_lag_read_s)
        if late_s <= 0:
            self._least_lag_s, self._least_lag_read_s = lag_s, self._read_s
        if self._is_moving and late_s > STALE_S:
            raise DriverError(
                f"{self._name}: its states came {late_s:.1f} s late while it moved: "
                f"the link is too slow, or its clock went back"
            )

    def _note(self, reading: Reading) -> None:
        values = reading.state.vector
        if self._values is None or np.abs(values - self._values).max() > _CHANGED_RAD_M:
            self._values, self._changed_s = values, time.monotonic()
        with self._motion_lock:
            self._check_path(values)
            if self._goal is None:
                return
            self._states_at_goal = self._states_at_goal + 1 if has_arrived(reading.state, self._goal) else 0
            if self._states_at_goal >= _SETTLED_STATES:
                self._goal = None
                self._path = self._path[1], self._path[1]

    def _check_path(self, values: Array) -> None:
        """Check that the joints are on the path, because only the path straight in joint space is free of collision.

        Raises:
            DriverError: if a joint is not between its start and its goal, or left the goal after arrival.
        """
        start, end = self._path
        if start is None or end is None or not start.shape == values.shape == end.shape:
            return
        limit_rad = GOAL_TOLERANCE_RAD if start is end else PATH_TOLERANCE_RAD
        if deviation := largest_path_deviation(values, start, end, limit_rad):
            joint, beyond_deg = deviation[0] + 1, float(f"{np.degrees(deviation[1]):.3g}")
            raise DriverError(
                f"{self._name}: joint {joint} is {beyond_deg:g} deg beyond its path. Look for a "
                f"person or a program that moves the arm, or a controller that sends wrong states"
            )

    def _serve_requests(self, robot: Robot) -> None:
        while not self._is_over:
            number, method, arguments = self._requests.get()
            try:
                answer = pickle.dumps((number, self._call_driver(robot, method, arguments), None))
            except BaseException as error:
                answer = pickle.dumps((number, None, _error_data(self._name, error)))
            self._channel.send(Kind.ANSWER, answer)

    def _call_driver(self, robot: Robot, method: str, arguments: tuple[Any, ...]) -> Any:
        with self._motion_lock:
            if self._must_stop:
                return None
            if method == "move":
                self._states_at_goal, self._changed_s = 0, time.monotonic()
                self._path, self._goal = (self._values, arguments[0].joints_rad), arguments[0]
            if method == "freedrive":
                self._is_in_freedrive, self._path = True, (None, None)
        try:
            result = getattr(robot, method)(*arguments)
        finally:
            if self._must_stop:  # the controller may have received the stop before this request
                self._stop_robot()
        if method == "freedrive":
            self._is_in_freedrive = arguments[0]
        return result

    def _send_heartbeats(self, robot: HasWatchdog) -> None:
        """Send heartbeats to the watchdog as long as the supervisor runs and states arrive."""
        try:
            while not self._is_over:
                now = time.monotonic()
                if now - self._supervisor_s < HANG_LIMIT_S and now - self._read_s < STALE_S:
                    robot.keep_alive()
                time.sleep(_HEARTBEAT_S)
        except BaseException as error:
            self._report(_error_text(self._name, error))

    def _stop(self) -> None:
        if not self._must_stop:
            self._must_stop = True
            self._stop_thread = _start_thread(self._stop_robot)

    def _stop_robot(self) -> None:
        """Stop the arm, and confirm the stop if the driver succeeds; else the supervisor kills this process."""
        robot = self._robot
        with suppress(Exception):
            if isinstance(robot, Moves):
                robot.stop()
            elif isinstance(robot, Freedrives) and self._is_in_freedrive:
                robot.freedrive(False)
            self._channel.send(Kind.STOPPED)
            if not getattr(robot, "is_connected", True):  # its library might connect again, and send its program
                self._leave()

    def _end(self) -> None:
        """Stop the arm if it moves, close the driver, and exit; each step has a timeout."""
        if self._is_over:
            return
        self._is_over = True
        with self._motion_lock:  # a motion begins before this, or never
            if self._is_moving:
                self._stop()
            self._must_stop = True
        if self._stop_thread is not None:  # also of an earlier order: a driver that is closed cannot send it any more
            self._stop_thread.join(STOP_S)
        _start_thread(self._close).join(CLOSE_S - STOP_S)
        self._leave()

    def _leave(self) -> None:
        self._channel.flush()
        os._exit(0)

    def _close(self) -> None:
        if self._robot is not None:
            with suppress(Exception):
                self._robot.close()


def _find_driver(place: Place) -> DriverKind:
    driver = place.cell.robots[place.name].driver
    kind = None if driver is None else driver_kind(driver.kind)
    assert kind is not None
    return kind


def _open_robot(kind: DriverKind, place: Place) -> Robot:
    robot = kind.robot(place)
    _, hard = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (_address_space_bytes() + _MEMORY_BYTES, hard))
    return robot


def _address_space_bytes() -> int:
    """Mapped address space of this process [bytes]; 8 GiB if the system does not report it."""
    try:
        with open("/proc/self/statm", encoding="ascii") as file:
            return int(file.read().split()[0]) * resource.getpagesize()
    except (OSError, ValueError):
        return 2**33


def _start_thread(function: Callable[..., object], *arguments: object) -> threading.Thread:
    thread = threading.Thread(target=function, args=arguments, daemon=True)
    thread.start()
    return thread


def _error_data(name: str, error: BaseException) -> tuple[type[BaseException], str, dict[str, Any]]:
    """Type, message and attributes of an error, for another process that raises it again."""
    if not isinstance(error, BasecalError):
        error = driver_failure(name, error)
    elif type(error).__module__ != BasecalError.__module__:  # a type that only the driver defines
        error = DriverError(str(error))
    return type(error), str(error), vars(error)


def _error_text(name: str, error: BaseException) -> str:
    text = str(error)
    if isinstance(error, OSError):
        text = f"its connection was closed ({error.strerror or error})"
    elif not isinstance(error, BasecalError):
        text = f"its link is lost, or its driver failed ({type(error).__name__}: {error})"
    return text if text.startswith(name) else f"{name}: {text}"


def main() -> None:
    """Serve the arm named in the first frame; output of libraries is redirected to the standard error."""
    out = os.dup(1)
    os.dup2(2, 1)
    sys.stdin = open(os.devnull, encoding="utf-8")  # noqa: SIM115
    ArmProcess(Channel(0, out)).run()


if __name__ == "__main__":
    main()
