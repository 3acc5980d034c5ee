"""Promises of a driver as rows of a table: the promise, the measurement, and the result."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from basecal.acquisition.driver import (
    ARRIVED_RAD_M,
    Camera,
    HasWatchdog,
    Moves,
    Reading,
    Robot,
    StopGuarantee,
    check_reading,
)
from basecal.acquisition.freshness import LEAST_HZ
from basecal.acquisition.supervision.limits import MOST_CLOCK_DRIFT, STALE_S
from basecal.cell import RobotState
from basecal.errors import DriverError
from basecal.geometry import Array

_MEASURED_S = 5.0
_PAUSE_S = 2.0
_MOVE_RAD, _SPEED_RAD_S = np.radians(3.0), np.radians(5.0)
_STOPPED_S = 0.5  # after a stop, or after the last heartbeat of a watchdog
_GAP_S = 0.5  # time without states that counts as an outage
_HEARTBEAT_S = 0.02
_AT_REST_RAD = 2e-4  # largest motion of an arm at rest in 0.1 s: 0.1 deg/s
_REST_S = 0.1
_START_TIMEOUT_S = 3.0
_STOP_TIMEOUT_S = 5.0

Item = TypeVar("Item")


@dataclass(frozen=True)
class Promise:
    """A promise in words, the measurement, and whether the promise holds; None if it was not measured."""

    promise: str
    measured: str
    holds: bool | None


def robot_promises(name: str, robot: Robot, guarantee: StopGuarantee, is_motion_allowed: bool) -> Iterator[Promise]:
    """Measure the promises of a robot, which must be at rest at first.

    Raises:
        DriverError: if the robot does not answer, or its states are implausible.
    """
    if not robot.is_live:
        yield Promise("states come on demand", "a person types each", None)
        return
    arrivals, values = record_states(name, robot, _MEASURED_S)
    yield from _stream_promises(arrivals, LEAST_HZ)
    noise = float(values.std(0).max())
    yield Promise(f"noise at rest below {ARRIVED_RAD_M:g} rad or m", f"{noise:.2g} (1 sigma)", noise < ARRIVED_RAD_M)
    yield from _stop_promises(name, robot, guarantee, is_motion_allowed)


def _stream_promises(arrivals: Arrivals, least_hz: float) -> Iterator[Promise]:
    rate_hz, gap_s, lag_s = arrivals.rate_hz, arrivals.longest_gap_s, arrivals.lag_s
    yield Promise(f"at least {least_hz:g} in a second", f"{rate_hz:.1f} in a second", rate_hz >= least_hz)
    yield Promise(f"no gap longer than {STALE_S:g} s", f"longest {gap_s:.3f} s", gap_s <= STALE_S)
    yield Promise(f"latency varies by less than {STALE_S:g} s", f"{lag_s:.3f} s", lag_s < STALE_S)
    yield Promise("stamps do not go back", f"{arrivals.steps_back} went back", arrivals.steps_back == 0)
    yield Promise("stamps advance", f"{arrivals.repeats} were repeated", arrivals.repeats == 0)
    drift = arrivals.drift
    yield Promise(
        f"clock within {MOST_CLOCK_DRIFT:.0%} of this machine's", f"{drift:+.2%}", abs(drift) < MOST_CLOCK_DRIFT
    )


def _stop_promises(name: str, robot: Robot, guarantee: StopGuarantee, is_motion_allowed: bool) -> Iterator[Promise]:
    if not isinstance(robot, Moves):
        return
    words = f"stops within {_STOPPED_S:g} s of an order"
    if not is_motion_allowed:
        yield Promise(words, "not measured: --go moves one joint by 3 deg", None)
    else:
        stop = measure_stop(name, robot, _MOVE_RAD, _SPEED_RAD_S)
        measured = f"{stop.time_s:.2f} s, {np.degrees(stop.distance_rad):.2f} deg"
        yield Promise(words, measured, stop.time_s <= _STOPPED_S)
    yield _guarantee_promise(name, robot, guarantee, is_motion_allowed)


def _guarantee_promise(name: str, robot: Robot, guarantee: StopGuarantee, is_motion_allowed: bool) -> Promise:
    words = f"STOP_GUARANTEE is {guarantee!r}"
    if guarantee == "none":
        return Promise(words, "the arm finishes its move if this computer is silent", None)
    if guarantee == "watchdog" and isinstance(robot, HasWatchdog) and is_motion_allowed:
        stop = measure_stop(name, robot, _MOVE_RAD, _SPEED_RAD_S, "silence")
        return Promise(words, f"stopped {stop.time_s:.2f} s after the last heartbeat", stop.time_s <= _STOPPED_S)
    return Promise(words, "declared by the driver, not measured", None)


def reconnection_promise(name: str, robot: Robot, watch_s: float) -> Promise:
    """Watch states while a person cuts the connection and restores it.

    Raises:
        DriverError: if states do not resume.
    """
    arrivals, _ = record_states(name, robot, watch_s)
    gap_s = arrivals.longest_gap_s
    words = "states resume after an outage"
    if gap_s < _GAP_S:
        return Promise(words, f"no outage was seen in {watch_s:g} s", None)
    return Promise(words, f"after {gap_s:.1f} s", True)


def camera_promises(camera: Camera) -> Iterator[Promise]:
    """Measure the promises of a camera.

    Raises:
        DriverError: if no image arrives.
    """
    if not camera.is_live:
        yield Promise("images come on demand", "a person or a program provides each", None)
        return
    arrivals = record_images(camera, _MEASURED_S)
    yield from _stream_promises(arrivals, 1.0)
    stale = count_stale_images(camera, 1 / arrivals.rate_hz, _PAUSE_S)
    yield Promise("images are fresh after a pause", f"{stale} had waited in a buffer", stale == 0)


@dataclass(frozen=True, eq=False)
class Arrivals:
    """Arrival times of states or images by this machine's clock, (n,), and their timestamps, (n,) [s]."""

    arrivals_s: Array
    stamps_s: Array

    @property
    def rate_hz(self) -> float:
        """Rate of states or images [Hz]."""
        return float((len(self.arrivals_s) - 1) / (self.arrivals_s[-1] - self.arrivals_s[0]))

    @property
    def longest_gap_s(self) -> float:
        """Longest time between arrivals [s]."""
        return float(np.diff(self.arrivals_s).max())

    @property
    def lag_s(self) -> float:
        """Range of the latency from timestamp to arrival [s]."""
        lag_s = self.arrivals_s - self.stamps_s
        return float(lag_s.max() - lag_s.min())

    @property
    def drift(self) -> float:
        """Relative drift of the device's clock against this machine's clock."""
        arrivals_s = self.arrivals_s - self.arrivals_s.mean()
        return float(arrivals_s @ (self.stamps_s - self.stamps_s.mean()) / (arrivals_s @ arrivals_s) - 1)

    @property
    def repeats(self) -> int:
        """Number of timestamps that equal the previous one."""
        return int(np.sum(np.diff(self.stamps_s) == 0))

    @property
    def steps_back(self) -> int:
        """Number of timestamps that are older than the previous one."""
        return int(np.sum(np.diff(self.stamps_s) < 0))


@dataclass(frozen=True)
class Stop:
    """Time and distance of an arm's stop, from the command: `time_s` [s], and `distance_rad` of the leading joint."""

    time_s: float
    distance_rad: float


def record_states(name: str, robot: Robot, duration_s: float) -> tuple[Arrivals, Array]:
    """Read states for a duration [s]; their arrivals, and their values, (n, k) [rad] or [m].

    Raises:
        DriverError: if a state does not arrive or is implausible, or fewer than three arrive.
    """
    arrivals_s, readings = _read_repeatedly(robot.state, duration_s)
    for reading in readings:
        check_reading(name, reading)
    stamps_s = np.array([reading.stamp_s for reading in readings])
    return Arrivals(arrivals_s, stamps_s), np.stack([reading.state.vector for reading in readings])


def record_images(camera: Camera, duration_s: float) -> Arrivals:
    """Read images for a duration [s]; their arrivals.

    Raises:
        DriverError: if an image does not arrive, or fewer than three arrive.
    """
    arrivals_s, images = _read_repeatedly(camera.image, duration_s)
    return Arrivals(arrivals_s, np.array([image.stamp_s for image in images]))


def _read_repeatedly(read: Callable[[], Item], duration_s: float) -> tuple[Array, list[Item]]:
    items: list[Item] = []
    arrivals_s: list[float] = []
    deadline_s = time.monotonic() + duration_s
    while not arrivals_s or arrivals_s[-1] < deadline_s:
        items.append(read())
        arrivals_s.append(time.monotonic())
    if len(items) < 3:
        raise DriverError(f"only {len(items)} of the 3 states or images that are needed came in {duration_s:g} s")
    return np.array(arrivals_s), items


def count_stale_images(camera: Camera, period_s: float, pause_s: float) -> int:
    """Count images that were buffered during a pause without reads: they arrive faster than exposures.

    Raises:
        DriverError: if an image does not arrive.
    """
    time.sleep(pause_s)
    count, previous_s = 0, time.monotonic()
    while True:
        camera.image()
        now_s = time.monotonic()
        if now_s - previous_s > period_s / 3:
            return max(count - 1, 0)  # the newest image may wait for its reader
        count, previous_s = count + 1, now_s


def measure_stop(name: str, robot: Robot, distance_rad: float, speed_rad_s: float, order: str = "stop") -> Stop:
    """Move the last joint, and measure its stop after a command, or after the last heartbeat to the watchdog.

    Args:
        name: Name of the robot.
        robot: A robot that can be moved, and reports joints.
        distance_rad: Length of the motion; it is stopped half way.
        speed_rad_s: Speed of the motion.
        order: `stop` for a command, or `silence` for missing heartbeats.

    Raises:
        DriverError: if the robot reports poses, does not start to move, or does not stop.
    """
    assert isinstance(robot, Moves)
    begin = _joints(name, robot)
    goal = begin + np.append(np.zeros(len(begin) - 1), distance_rad)
    with _heartbeats(robot) as silence:
        try:
            robot.move(RobotState(joints_rad=goal), speed_rad_s)
            _wait_until(name, robot, lambda joints: abs(joints[-1] - begin[-1]) > distance_rad / 2, _START_TIMEOUT_S)
            ordered_s, joints_at_order = time.monotonic(), _joints(name, robot)
            silence() if order == "silence" else robot.stop()
            rested_s, rest = _wait_for_rest(name, robot)
        finally:
            with suppress(Exception):
                robot.stop()
    return Stop(max(rested_s - ordered_s, 0.0), float(np.abs(rest - joints_at_order).max()))


def _joints(name: str, robot: Robot) -> Array:
    reading: Reading = robot.state()
    check_reading(name, reading)
    if reading.state.joints_rad is None:
        raise DriverError(f"{name}: it reports poses: a move of one joint needs a cell with its URDF")
    return reading.state.joints_rad


def _wait_until(name: str, robot: Robot, is_done: Callable[[Array], bool], timeout_s: float) -> None:
    deadline_s = time.monotonic() + timeout_s
    while not is_done(_joints(name, robot)):
        if time.monotonic() > deadline_s:
            raise DriverError(f"{name}: it did not move as requested within {timeout_s:g} s")


def _wait_for_rest(name: str, robot: Robot) -> tuple[float, Array]:
    """Wait until the arm is at rest; the start of the rest [s], and the joints, (n,) [rad]."""
    since_s, reference = time.monotonic(), _joints(name, robot)
    deadline_s = since_s + _STOP_TIMEOUT_S
    while time.monotonic() - since_s < _REST_S:
        joints = _joints(name, robot)
        if np.abs(joints - reference).max() > _AT_REST_RAD:
            since_s, reference = time.monotonic(), joints
        if time.monotonic() > deadline_s:
            raise DriverError(f"{name}: it did not stop within {_STOP_TIMEOUT_S:g} s. Use the emergency stop")
    return since_s, reference


@contextmanager
def _heartbeats(robot: Robot) -> Iterator[Callable[[], None]]:
    """Context that sends heartbeats to a robot's watchdog, if any; the yielded function ends them."""
    ended = threading.Event()

    def send_heartbeats() -> None:
        """Send heartbeats until the context or the yielded function ends them."""
        with suppress(Exception):
            while isinstance(robot, HasWatchdog) and not ended.wait(_HEARTBEAT_S):
                robot.keep_alive()

    thread = threading.Thread(target=send_heartbeats, daemon=True)
    thread.start()
    try:
        yield ended.set
    finally:
        ended.set()
