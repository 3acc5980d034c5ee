"""Promises of a driver as lines of a table: what is promised, what was measured, and whether it holds."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from basecal.acquisition.driver import Camera, HasWatchdog, Moves, Robot, StopGuarantee
from basecal.acquisition.driver_check.measuring import (
    Arrivals,
    measure_stop,
    record_images,
    record_states,
    stale_images,
)
from basecal.acquisition.freshness import LEAST_HZ
from basecal.acquisition.states import ARRIVED_RAD_M
from basecal.acquisition.supervision.limits import STALE_S

_MEASURED_S = 5.0
_PAUSE_S = 2.0
_MOST_CLOCK_DRIFT = 0.01
_MOVE_RAD, _SPEED_RAD_S = np.radians(3.0), np.radians(5.0)
_STOPPED_S = 0.5  # after an order, or after a watchdog heard nothing more
_GAP_S = 0.5  # without states, which counts as an outage


@dataclass(frozen=True)
class Promise:
    """One promise: its words, what was measured, and whether it holds; None if it was not measured."""

    promise: str
    measured: str
    holds: bool | None


def robot_promises(name: str, robot: Robot, guarantee: StopGuarantee, is_motion_allowed: bool) -> Iterator[Promise]:
    """Measure the promises of a robot, which stands still at first.

    Raises:
        DriverError: if it does not answer, or gives implausible states.
    """
    if not robot.is_live:
        yield Promise("states come on demand", "a person answers for each", None)
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
    yield Promise("stamps do not stand still", f"{arrivals.repeats} were repeated", arrivals.repeats == 0)
    drift = arrivals.drift
    yield Promise(
        f"clock within {_MOST_CLOCK_DRIFT:.0%} of this machine's", f"{drift:+.2%}", abs(drift) < _MOST_CLOCK_DRIFT
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
        return Promise(words, f"stood {stop.time_s:.2f} s after the last heartbeat", stop.time_s <= _STOPPED_S)
    return Promise(words, "declared by the driver, not measured", None)


def reconnection_promise(name: str, robot: Robot, watch_s: float) -> Promise:
    """Watch states while a person cuts the connection and restores it.

    Raises:
        DriverError: if states do not come again.
    """
    arrivals, _ = record_states(name, robot, watch_s)
    gap_s = arrivals.longest_gap_s
    words = "states go on after an outage"
    if gap_s < _GAP_S:
        return Promise(words, f"no outage was seen in {watch_s:g} s", None)
    return Promise(words, f"after {gap_s:.1f} s", True)


def camera_promises(camera: Camera) -> Iterator[Promise]:
    """Measure the promises of a camera.

    Raises:
        DriverError: if no image comes.
    """
    if not camera.is_live:
        yield Promise("images come on demand", "a person or a program gives each", None)
        return
    arrivals = record_images(camera, _MEASURED_S)
    yield from _stream_promises(arrivals, 1.0)
    stale = stale_images(camera, 1 / arrivals.rate_hz, _PAUSE_S)
    yield Promise("images are fresh after a pause", f"{stale} had waited in a buffer", stale == 0)
