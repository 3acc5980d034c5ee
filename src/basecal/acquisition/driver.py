"""The protocols of drivers: robots and cameras, and the values that they return.

A driver is a module with `open_robot(place) -> Robot`, `open_camera(place) -> Camera`, or both. Each optional
capability of a robot or camera is a protocol of its own. Reads block: `state` and `image` return when newer data is
available, so that callers need no polling rate.
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
from basecal.errors import BasecalError, DatasetError, DriverError, count_text, list_names
from basecal.fields.problems import Loc, field_name, line_number
from basecal.fields.values import Entry
from basecal.geometry import Array

Grey = NDArray[np.integer[Any]]
Options = TypeVar("Options", bound=Entry)

StopGuarantee = Literal["watchdog", "short-horizon", "none"]
"""Mechanism that stops an arm if this computer is silent, declared as `STOP_GUARANTEE` in a driver's module.

`watchdog`: the controller stops the arm within half a second. `short-horizon`: the driver sends only goals that the arm
reaches within 0.3 s. `none`: the arm finishes its move.
"""
ARRIVED_RAD_M = 2e-3
"""Distance from the goal at which an arm counts as arrived [rad, m]: controllers round or stop slightly short."""
_LARGEST_JOINT_RAD = 1e3  # 159 turns, more than any turn counter
_LARGEST_DISTANCE_M = 1e3  # of a flange from its base
_ROTATION_TOLERANCE = 1e-3  # for the orthonormality of a rotation matrix: printed numbers are rounded


@dataclass(frozen=True)
class Secret:
    """A secret for a driver's login: the environment variable that holds it, and a description of its owner."""

    variable: str
    owner: str


@dataclass(frozen=True, eq=False)
class Reading:
    """State reported by a robot, with its timestamp `stamp_s` [s]."""

    stamp_s: float
    state: RobotState


@dataclass(frozen=True, eq=False)
class CameraImage:
    """An image of a camera with its timestamp.

    Attributes:
        stamp_s: Middle of the exposure [s], by the camera's clock.
        grey: Pixel values, (h, w) uint8 or uint16.
        exposed_s: Earliest possible time of exposure [s], by `time.monotonic()`; a driver leaves it None.
        source: File from which the image was read; empty if none.
        note: Note for the user about the image's arrival; empty if none.
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
        name: Name of the robot or camera in the cell.
        cell: The cell.
        folder: The cell's folder.
        options: All fields of `driver:` in `cell.yaml` except `kind`.
        allow_plaintext: Whether the user permits sending a password without encryption; `cell.yaml` cannot permit it.
    """

    name: str
    cell: Cell
    folder: Path
    options: Mapping[str, Any] = field(default_factory=dict)
    allow_plaintext: bool = False

    @property
    def section(self) -> Literal["robots", "cameras"]:
        """The section of `cell.yaml` that contains the robot or camera."""
        return "robots" if self.name in self.cell.robots else "cameras"

    def error(self, message: str, field: str = "driver") -> DatasetError:
        """An error about a field of the robot or camera in `cell.yaml`."""
        path, loc = self.folder / "cell.yaml", (self.section, self.name, *field.split("."))
        return DatasetError(path, message, line_number(loc, _lines_of_file(path)), field_name(loc))

    def check_joints(self, state: RobotState) -> None:
        """Check that a state has a value for each joint of the robot's kinematics, if the cell states these.

        Raises:
            DriverError: if it has another number of joints.
        """
        chain = self.cell.robots[self.name].chain
        if chain is None or state.joints_rad is None or len(state.joints_rad) == chain.n:
            return
        raise DriverError(
            f"{self.name}: its driver reports {count_text(len(state.joints_rad), 'joint')}, its chain in cell.yaml "
            f"has {chain.n}: {list_names(chain.joint_names)}. Report these in this order"
        )


@runtime_checkable
class Robot(Protocol):
    """A robot that reports its state.

    Attributes:
        is_live: Whether states arrive continuously; False if each one is typed by a person.
    """

    is_live: bool

    def state(self) -> Reading:
        """Wait for a state newer than the last returned one.

        Raises:
            DriverError: if no newer state arrives.
        """

    def close(self) -> None:
        """Close the connection to the robot, without a motion."""


@runtime_checkable
class Moves(Protocol):
    """The methods of a robot that can be moved."""

    def move(self, to: RobotState, speed_rad_s: float) -> None:
        """Start a motion to a goal, straight in joint space, and return without waiting for its end.

        Args:
            to: Joints, or a pose of the flange, whichever `state` returns.
            speed_rad_s: Speed limit of any joint [rad/s].

        Raises:
            DriverError: if the robot cannot move to the goal.
        """

    def stop(self) -> None:
        """Stop the robot as fast as possible; called from a separate thread, also while another call hangs."""


@runtime_checkable
class ChecksGoals(Protocol):
    """The method of a robot whose controller can check a goal before a motion."""

    def goal_refusal(self, to: RobotState) -> str:
        """The controller's reason to refuse a goal; empty if it accepts the goal.

        Raises:
            DriverError: if the controller does not answer.
        """


@runtime_checkable
class HasWatchdog(Protocol):
    """The method of a robot whose controller stops it if heartbeats of this computer are missing."""

    def keep_alive(self) -> None:
        """Send a heartbeat to the controller; called every 20 ms by a separate thread.

        Raises:
            DriverError: if the connection to the controller is lost.
        """


@runtime_checkable
class Freedrives(Protocol):
    """The method of a robot that a person can lead by hand."""

    def freedrive(self, on: bool) -> None:
        """Switch freedrive on or off."""


@runtime_checkable
class Camera(Protocol):
    """A camera.

    A driver may define `is_on_demand` (True if each image is exposed on request; a thread reads any other live camera
    continuously). It may define `is_stamped` (True if timestamps are times of exposure, by any clock). It may define
    `wait_s` (timeout for an image [s], 10 s by default).
    """

    @property
    def is_live(self) -> bool:
        """Whether images arrive continuously, without a request."""

    def image(self) -> CameraImage:
        """Wait for an image newer than the last returned one.

        Raises:
            DriverError: if no newer image arrives.
        """

    def close(self) -> None:
        """Close the connection to the camera."""


@runtime_checkable
class Switches(Protocol):
    """The method of a camera that can switch the LED in its view."""

    def light(self, on: bool) -> None:
        """Switch the LED on or off; the next image shows the new state."""


@dataclass(frozen=True)
class DriverKind:
    """A kind of driver for robots, for cameras, or for both.

    Attributes:
        open_robot: Opens a robot; None if the driver is for cameras only.
        open_camera: Opens a camera; None if the driver is for robots only.
        stop_guarantee: Mechanism that stops an arm if this computer is silent.
        needs_own_process: Whether each arm gets a process of its own; False for typed and simulated states.
        reaches: Describes the resources outside the cell's folder that the driver accesses; "" if none.
        secret: Returns the secret for the login; None if the driver needs none.
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
            DriverError: if the driver is for cameras only, or the robot does not answer.
        """
        if self.open_robot is None:
            raise DriverError(f"{place.name}: its driver is for cameras only")
        with driver_errors(place.name):
            return self.open_robot(place)

    def camera(self, place: Place) -> Camera:
        """Open a camera.

        Raises:
            DriverError: if the driver is for robots only, or the camera does not answer.
        """
        if self.open_camera is None:
            raise DriverError(f"{place.name}: its driver is for robots only")
        with driver_errors(place.name):
            return self.open_camera(place)


@contextmanager
def driver_errors(name: str) -> Iterator[None]:
    """A context that turns an error of a driver or its library into a `DriverError` with the device's name."""
    try:
        yield
    except Exception as error:
        if isinstance(error, BasecalError) or is_own_fault(error):
            raise
        raise driver_failure(name, error) from error


def driver_failure(name: str, error: BaseException) -> DriverError:
    """A `DriverError` of a device for an error of a vendor's library."""
    return DriverError(f"{name}: its driver failed ({type(error).__name__}: {error})")


def checked_options(place: Place, kind: type[Options]) -> Options:
    """The validated options of a driver.

    Raises:
        DatasetError: if an option is unknown or invalid; the error names line and field in `cell.yaml`.
    """
    path, loc, options = place.folder / "cell.yaml", (place.section, place.name, "driver"), dict(place.options)
    try:
        return check_entry(kind, options, str(path), loc=loc)
    except DatasetError:
        return check_entry(kind, options, str(path), _lines_of_file(path), loc)


def _lines_of_file(path: Path) -> Mapping[Loc, int]:
    """Line numbers of a `cell.yaml` by location; none if it cannot be read, as a cell may be made without a file."""
    from basecal.cell.format.yaml_text import parse_yaml, read_text

    try:
        return parse_yaml(read_text(path, ""), str(path)).lines
    except BasecalError:
        return {}


def has_arrived(state: RobotState, goal: RobotState) -> bool:
    """Whether a robot is at its goal."""
    return bool(np.abs(state.vector - goal.vector).max() < ARRIVED_RAD_M)


PATH_TOLERANCE_RAD = 0.05
"""Tolerance of a joint beyond the range between start and goal: more than overshoot, play and noise of any arm."""


GOAL_TOLERANCE_RAD = 0.01
"""Tolerance of a joint at its goal after arrival: more than noise and settling, less than a push."""


def largest_path_deviation(
    joints_rad: Array, start_rad: Array, goal_rad: Array, limit_rad: float
) -> tuple[int, float] | None:
    """Index of the joint farthest outside the range between its start and its goal, and the excess [rad].

    None if the excess of every joint is within a limit. All arrays are (joints,) [rad].
    """
    excess_rad = np.maximum(np.minimum(start_rad, goal_rad) - joints_rad, joints_rad - np.maximum(start_rad, goal_rad))
    worst = int(np.argmax(excess_rad))
    return (worst, float(excess_rad[worst])) if excess_rad[worst] > limit_rad else None


def check_reading(name: str, reading: Reading) -> None:
    """Check that the state of a robot is plausible.

    Raises:
        DriverError: if a number is not finite, a joint is beyond 1000 rad, or a flange is beyond 1 km.
    """
    if problem := _implausibility(reading):
        raise DriverError(
            f"{name}: implausible state: {problem}. The controller or its driver sends wrong numbers. "
            f"Check the driver's units and what the controller shows"
        )


def _implausibility(reading: Reading) -> str:
    if (reading.state.joints_rad is None) == (reading.state.base_from_flange is None):
        return "expected either joints or a pose of the flange"
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
    return (
        ""
        if np.abs(rotation @ rotation.T - np.eye(3)).max() < _ROTATION_TOLERANCE
        else "its rotation matrix is not orthonormal"
    )
