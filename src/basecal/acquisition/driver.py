"""The protocols of drivers: robots and cameras, and the values that they give.

A driver is a module with `open_robot(place) -> Robot`, `open_camera(place) -> Camera`, or both. What not every robot or
camera can do is a face of its own, which a driver has or has not. Reading waits: `state` and `image` come back with
something newer than before, so that nobody has to know how often to ask.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, Protocol, TypeVar, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from basecal.box import is_own_fault
from basecal.cell import Cell, RobotState
from basecal.cell.schema.errors import check_entry
from basecal.errors import BasecalError, DatasetError, DriverError
from basecal.fields.values import Entry
from basecal.geometry import Array

Grey = NDArray[np.integer[Any]]
Options = TypeVar("Options", bound=Entry)

StopGuarantee = Literal["watchdog", "short-horizon", "none"]
"""What stops an arm when this computer is silent, as `STOP_GUARANTEE` of a driver's module declares it.

`watchdog`: its controller stops it within half a second. `short-horizon`: it is only ever sent goals that it reaches
within 0.3 s. `none`: it finishes its move.
"""
ARRIVED_RAD_M = 2e-3
"""Distance from its goal at which an arm counts as arrived: controllers round, and some stop a little short."""
_LARGEST_JOINT_RAD = 1e3  # of a joint: 159 turns, more than any counter of turns
_LARGEST_DISTANCE_M = 1e3  # of a flange from its base
_ROTATION_TOLERANCE = 1e-3  # by which a rotation matrix may miss orthonormality: printed numbers are rounded


@dataclass(frozen=True)
class Secret:
    """A secret that a driver signs on with: the environment variable that holds it, and whose it is, in words."""

    variable: str
    owner: str


@dataclass(frozen=True, eq=False)
class Reading:
    """Where a robot says it is: `state`, with the time `stamp_s` at which it was there [s]."""

    stamp_s: float
    state: RobotState


@dataclass(frozen=True, eq=False)
class CameraImage:
    """An image of a camera with its stamp.

    Attributes:
        stamp_s: When it was exposed, in the middle [s], by the camera's clock.
        grey: (h, w) of uint8 or uint16.
        exposed_s: The earliest that it was exposed, by `time.monotonic()` of this machine; a driver leaves it None.
        source: The file it was read from, if it is one.
        note: What a person should know of how it came; empty if nothing.
    """

    stamp_s: float
    grey: Grey
    exposed_s: float | None = None
    source: str = ""
    note: str = ""


@dataclass(frozen=True, eq=False)
class Place:
    """The folder, name and options with which a driver is opened.

    Attributes:
        name: The robot or camera, by its name in the cell.
        cell: The cell it is in.
        folder: The cell's folder.
        options: What stands beside `kind` in its `driver:`.
        allow_plaintext: Whether the user allowed to send a password without encryption; no cell can.
    """

    name: str
    cell: Cell
    folder: Path
    options: Mapping[str, Any] = field(default_factory=dict)
    allow_plaintext: bool = False

    @property
    def section(self) -> Literal["robots", "cameras"]:
        """The section of `cell.yaml` that it stands in."""
        return "robots" if self.name in self.cell.robots else "cameras"

    def error(self, message: str, field: str = "driver") -> DatasetError:
        """An error of a field of its entry in `cell.yaml`."""
        return DatasetError(self.folder / "cell.yaml", message, field=f"{self.section}.{self.name}.{field}")


@runtime_checkable
class Robot(Protocol):
    """A robot that says where it is.

    Attributes:
        is_live: Whether `state` is updated continuously; not where a person has to be asked.
    """

    is_live: bool

    def state(self) -> Reading:
        """Wait for a state newer than the last one given.

        Raises:
            DriverError: if there is none any more.
        """

    def close(self) -> None:
        """Let go of the robot; it stays where it is."""


@runtime_checkable
class Moves(Protocol):
    """The methods of a robot that can be sent somewhere."""

    def move(self, to: RobotState, speed_rad_s: float) -> None:
        """Begin to go there, each joint straight to its goal; at once, without waiting for the end.

        Args:
            to: Joints, or a pose of the flange, in the kind that `state` gives.
            speed_rad_s: The fastest that any joint may turn [rad/s].

        Raises:
            DriverError: if it cannot go there.
        """

    def stop(self) -> None:
        """Stand still as soon as it can; called from another thread than the rest, also while a call hangs."""


@runtime_checkable
class ChecksGoals(Protocol):
    """The method of a robot whose controller can be asked whether it would go somewhere."""

    def goal_refusal(self, to: RobotState) -> str:
        """Why the controller would not go there, in words; empty if it would.

        Raises:
            DriverError: if it cannot be asked.
        """


@runtime_checkable
class HasWatchdog(Protocol):
    """The method of a robot whose controller stops it unless this computer reports again and again that it is well."""

    def keep_alive(self) -> None:
        """Report to the controller that this computer is well; called every 20 ms by a thread of its own.

        Raises:
            DriverError: if the controller no longer listens.
        """


@runtime_checkable
class Freedrives(Protocol):
    """The methods of a robot that a person can lead by hand."""

    def freedrive(self, on: bool) -> None:
        """Let the arm be led, or hold it."""


@runtime_checkable
class Camera(Protocol):
    """A camera.

    A driver may also state `is_on_demand` (True if each image is exposed when asked; a thread reads any other live
    camera without pause). It may state `is_stamped` (True if stamps are times of exposure, by any clock). It may state
    `wait_s` (how long an image may take, 10 s by default).

    """

    @property
    def is_live(self) -> bool:
        """Whether images come without a request, one after another."""

    def image(self) -> CameraImage:
        """Wait for an image newer than the last one given.

        Raises:
            DriverError: if there is none any more.
        """

    def close(self) -> None:
        """Let go of the camera."""


@runtime_checkable
class Switches(Protocol):
    """The method of a camera that can switch the LED it looks at."""

    def light(self, on: bool) -> None:
        """Switch the light; the next image shows it so."""


@dataclass(frozen=True)
class DriverKind:
    """A kind of driver of robots, of cameras, or of both.

    Attributes:
        open_robot: Opens a robot; None if it is for cameras only.
        open_camera: Opens a camera; None if it is for robots only.
        stop_guarantee: What stops an arm when this computer is silent.
        needs_own_process: Whether an arm gets a process of its own: all but those that ask a person or simulate.
        reaches: What it reaches outside of the cell's folder, a line for a person, or "" if nothing.
        secret: What it signs on with.
    """

    open_robot: Callable[[Place], Robot] | None = None
    open_camera: Callable[[Place], Camera] | None = None
    stop_guarantee: StopGuarantee = "none"
    needs_own_process: bool = True
    reaches: Callable[[Place], str] | None = None
    secret: Callable[[Place], Secret | None] | None = None

    def robot(self, place: Place) -> Robot:
        """Open a robot.

        Raises:
            DriverError: if it is for cameras only, or the robot does not answer.
        """
        if self.open_robot is None:
            raise DriverError(f"{place.name}: its driver is for cameras only")
        with driver_errors(place.name):
            return self.open_robot(place)

    def camera(self, place: Place) -> Camera:
        """Open a camera.

        Raises:
            DriverError: if it is for robots only, or the camera does not answer.
        """
        if self.open_camera is None:
            raise DriverError(f"{place.name}: its driver is for robots only")
        with driver_errors(place.name):
            return self.open_camera(place)


@contextmanager
def driver_errors(name: str) -> Iterator[None]:
    """A context that names the device in an error of its driver, or of the driver's library."""
    try:
        yield
    except Exception as error:
        if isinstance(error, BasecalError) or is_own_fault(error):
            raise
        raise driver_failure(name, error) from error


def driver_failure(name: str, error: BaseException) -> DriverError:
    """An error of a maker's library as one of the device."""
    return DriverError(f"{name}: its driver failed ({type(error).__name__}: {error})")


def checked_options(place: Place, kind: type[Options]) -> Options:
    """The options of a driver, checked.

    Raises:
        DatasetError: if one is unknown or not as expected; it names the field in `cell.yaml`.
    """
    where = (place.section, place.name, "driver")
    return check_entry(kind, dict(place.options), str(place.folder / "cell.yaml"), place=where)


def has_arrived(state: RobotState, goal: RobotState) -> bool:
    """Whether an arm is where it was sent."""
    return bool(np.abs(state.vector - goal.vector).max() < ARRIVED_RAD_M)


OFF_WAY_RAD = 0.05
"""By which a joint may leave the range between start and goal: more than overshoot, play and noise of any arm."""


OFF_PLACE_RAD = 0.01
"""By which a joint may leave the place where it arrived: more than noise and settling, less than a push."""


def joint_off_way(joints_rad: Array, start_rad: Array, goal_rad: Array, limit_rad: float) -> tuple[int, float] | None:
    """The joint that is farthest outside of the range between its start and its goal, and by how much [rad].

    None if each joint is within that range, to a limit. All arrays are (joints,).
    """
    beyond = np.maximum(np.minimum(start_rad, goal_rad) - joints_rad, joints_rad - np.maximum(start_rad, goal_rad))
    worst = int(np.argmax(beyond))
    return (worst, float(beyond[worst])) if beyond[worst] > limit_rad else None


def check_reading(name: str, reading: Reading) -> None:
    """Refuse a reading that no robot can give.

    Raises:
        DriverError: if a number is not finite, a joint is beyond 1000 rad, or a flange is beyond 1 km.
    """
    if problem := _problem(reading):
        raise DriverError(
            f"{name}: implausible state: {problem}. The controller or its driver sends wrong numbers. "
            f"Check the driver's units and what the controller shows"
        )


def _problem(reading: Reading) -> str:
    if (reading.state.joints_rad is None) == (reading.state.base_from_flange is None):
        return "expected joints or a pose of the flange, one of them"
    values = reading.state.vector
    if not np.isfinite(reading.stamp_s):
        return f"its stamp is {reading.stamp_s}"
    if not values.size:
        return "it has no joints"
    if not np.all(np.isfinite(values)):
        return f"a number is not finite: {values}"
    if reading.state.joints_rad is not None:
        worst = int(np.argmax(np.abs(values)))
        return f"joint {worst + 1} is at {values[worst]:.3g} rad" if abs(values[worst]) > _LARGEST_JOINT_RAD else ""
    if (distance_m := float(np.abs(values[:3]).max())) > _LARGEST_DISTANCE_M:
        return f"the flange is {distance_m:.3g} m from its base"
    rotation = values[3:].reshape(3, 3)
    return "" if np.abs(rotation @ rotation.T - np.eye(3)).max() < _ROTATION_TOLERANCE else "its rotation is none"
