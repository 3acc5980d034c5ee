"""The rig: the robots and cameras of a cell, opened by their drivers."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from basecal.acquisition.driver import Camera, ChecksGoals, DriverKind, Moves, Place, Robot, StopGuarantee
from basecal.acquisition.drivers.registry import driver_kind, driver_names
from basecal.acquisition.images.feed import feed_camera
from basecal.acquisition.images.latency import ArmMotion
from basecal.acquisition.supervision.arms import Arms
from basecal.acquisition.supervision.signals import interrupt_main_thread, routed_signals
from basecal.cell import Cell, RobotState
from basecal.errors import DriverError, InputError, UsageError, spelling_hint
from basecal.estimation.settings import LOG
from basecal.planning.sketch import Sketch

_STOP_TIMEOUT_S = 1.0  # for the stops of all robots; the process of a supervised arm is killed after 0.3 s
_CLOSE_TIMEOUT_S = 0.5  # for a camera or robot to close: its stream may hang

_Openers = Mapping[str, tuple[DriverKind, Place]]


@dataclass(frozen=True, eq=False)
class Rig:
    """The robots and cameras of a cell that have a driver.

    Attributes:
        robots: Robots by name.
        cameras: Cameras by name.
        arms: Times at which the arms moved.
        guarantees: Mechanism that stops each robot if this computer is silent, by name.
        request_stop: Requests a stop of all arms and the end of the capture, with a reason; thread-safe.
    """

    robots: Mapping[str, Robot]
    cameras: Mapping[str, Camera]
    arms: ArmMotion = field(default_factory=ArmMotion)
    guarantees: Mapping[str, StopGuarantee] = field(default_factory=dict)
    request_stop: Callable[[str], None] = lambda reason: None

    def stop(self) -> None:
        """Stop all robots in parallel; a robot that does not confirm the stop is logged as an error."""
        stops = {name: robot.stop for name, robot in movers(self).items()}
        for name in _call_in_parallel(stops, _STOP_TIMEOUT_S):
            LOG.error("%s did not confirm a stop: look at the arm", name)


@contextmanager
def open_rig(cell: Cell, folder: Path, allow_plaintext: bool = False) -> Iterator[Rig]:
    """Context of a cell's open rig; on an error or a signal, all robots stop before it is closed.

    Each robot's driver runs in a process of its own, unless the driver declares that it needs none. SIGTERM and SIGHUP
    end the capture in the same way as Ctrl-C.

    Raises:
        DatasetError: if a driver is unknown, does not support the device, or has an invalid option.
        DriverError: if a robot or camera does not answer, or all arms were stopped.
    """
    places = _find_openers(cell, folder, "robots", allow_plaintext)
    supervised = {name: place for name, (kind, place) in places.items() if kind.needs_own_process}
    local = {name: opener for name, opener in places.items() if name not in supervised}
    supervisor: list[Arms] = []
    stop_reasons: list[str] = []  # stops of a rig without a supervisor
    with ExitStack() as opened:
        signals_fd = opened.enter_context(
            routed_signals(lambda: supervisor[0].interruption if supervisor else "".join(stop_reasons[:1]))
        )
        try:
            if supervised:
                supervisor.append(Arms(supervised, signals_fd))
                opened.callback(supervisor[0].close)
            robots: dict[str, Robot] = {name: kind.robot(place) for name, (kind, place) in local.items()}
            motion = ArmMotion()
            cameras = {
                name: feed_camera(name, kind.camera(place), motion)
                for name, (kind, place) in _find_openers(cell, folder, "cameras", allow_plaintext).items()
            }
            local_devices: dict[str, Robot | Camera] = {**robots, **cameras}
            closes = {name: device.close for name, device in local_devices.items()}
            opened.callback(_call_in_parallel, closes, _CLOSE_TIMEOUT_S)
            robots |= supervisor[0].open_arms() if supervised else {}
            guarantees = {name: kind.stop_guarantee for name, (kind, _) in places.items()}
            stop = supervisor[0].request_stop if supervisor else lambda reason: _interrupt(stop_reasons, reason)
            rig = Rig({name: robots[name] for name in places}, cameras, motion, guarantees, stop)
            try:
                yield rig
            except BaseException as error:
                rig.stop()
                report = supervisor[0].standstill_report if supervisor else ""
                if report and isinstance(error, DriverError):  # such as a timeout that ran out meanwhile
                    raise DriverError(report) from error
                raise
        finally:
            for arms in supervisor:
                arms.stop_interrupting()


def _interrupt(reasons: list[str], reason: str) -> None:
    """Interrupt the main thread, which then closes the rig."""
    reasons.append(f"{reason}. What was recorded is kept.")
    interrupt_main_thread()


def movers(rig: Rig) -> dict[str, Moves]:
    """Robots that can be moved, by name."""
    return {name: robot for name, robot in rig.robots.items() if isinstance(robot, Moves)}


def starting_states(rig: Rig, sketch: Sketch) -> dict[str, RobotState]:
    """Current states of the robots, by name.

    Raises:
        InputError: if a robot of the sketch's camera or target has no driver.
        DriverError: if a robot does not answer.
    """
    missing = [name for name in sketch.movers if name not in rig.robots]
    if missing:
        raise InputError(f"robot {missing[0]!r} has no `driver` in cell.yaml: nothing can be planned for it")
    return {name: robot.state().state for name, robot in rig.robots.items()}


def goal_checks(robots: Mapping[str, object]) -> dict[str, Callable[[RobotState], str]]:
    """Goal checks by the robots' controllers, by name; a robot without a check accepts every goal."""
    return {
        name: robot.goal_refusal if isinstance(robot, ChecksGoals) else lambda state: ""
        for name, robot in robots.items()
    }


def check_cameras(rig: Rig) -> None:
    """Check that at least one camera has a driver.

    Raises:
        InputError: if no camera has one.
    """
    if not rig.cameras:
        raise InputError("no camera of the cell has a `driver`: state one in cell.yaml")


def check_guarantees(rig: Rig, is_none_accepted: bool) -> None:
    """Check that every arm stops if this program fails, unless the user accepts arms without a watchdog.

    Raises:
        UsageError: if an arm does not stop, and the user does not accept it.
    """
    unguarded = [name for name in movers(rig) if rig.guarantees.get(name) == "none"]
    if unguarded and not is_none_accepted:
        raise UsageError(
            f"{unguarded[0]}: no watchdog stops this arm. If this program or the network fails, it finishes its move. "
            f"Add --accept-no-watchdog to move it all the same, with a hand on the emergency stop."
        )


def _call_in_parallel(calls: Mapping[str, Callable[[], None]], timeout_s: float) -> list[str]:
    """Make calls in parallel threads with a shared timeout [s]; names of the calls that failed or did not return."""
    failed = list(calls)

    def call_silently(name: str) -> None:
        """Make one call, and suppress its exceptions."""
        with suppress(Exception):
            calls[name]()
            failed.remove(name)

    threads = [threading.Thread(target=call_silently, args=(name,), daemon=True) for name in calls]
    for thread in threads:
        thread.start()
    deadline_s = time.monotonic() + timeout_s
    for thread in threads:
        thread.join(max(deadline_s - time.monotonic(), 0.0))
    return list(failed)


def openers(cell: Cell, folder: Path) -> list[tuple[DriverKind, Place]]:
    """Drivers and places of all robots and cameras, which are not opened.

    Raises:
        DatasetError: if a driver is unknown, or does not support the kind of device.
    """
    return [*_find_openers(cell, folder, "robots").values(), *_find_openers(cell, folder, "cameras").values()]


def _find_openers(
    cell: Cell, folder: Path, section: Literal["robots", "cameras"], allow_plaintext: bool = False
) -> _Openers:
    """Drivers and places of all robots or cameras that have a driver, by name.

    Raises:
        DatasetError: if a driver is unknown, or does not support the kind of device.
    """
    devices = cell.robots if section == "robots" else cell.cameras
    openers = {}
    for name, device in devices.items():
        if device.driver is not None:
            place = Place(name, cell, folder, device.driver.options, allow_plaintext)
            openers[name] = (_find_driver(device.driver.kind, place), place)
    return openers


def _find_driver(name: str, place: Place) -> DriverKind:
    kind = driver_kind(name)
    if kind is None:
        known = driver_names()
        message = f"no driver {name!r}{spelling_hint(name, known)}; there are: {', '.join(known)}"
        raise place.error(message, "driver.kind")
    if (kind.open_robot if place.section == "robots" else kind.open_camera) is None:
        others = "cameras" if place.section == "robots" else "robots"
        raise place.error(f"driver {name!r} is for {others} only", "driver.kind")
    return kind
