"""The arms and cameras of a simulated cell that runs in a separate process (`basecal simulate CELL --process`)."""

from __future__ import annotations

import base64
from typing import Annotated, Any, TypeVar

import numpy as np
from pydantic import Field, ValidationError

from basecal.acquisition.driver import CameraImage, Place, Reading, StopGuarantee, checked_options
from basecal.cell import RobotState
from basecal.cell.schema.errors import first_problem
from basecal.errors import DriverError
from basecal.fields.values import Entry, Number
from basecal.simulation.running.protocol import (
    MOST_JOINTS,
    Address,
    Connection,
    connect,
    describe_address,
    read_address,
)
from basecal.vision.image_file import grey_image

_Answer = TypeVar("_Answer", bound=Entry)


STOP_GUARANTEE: StopGuarantee = "watchdog"

NEEDS_OWN_PROCESS = False
"""Simulated arms need no supervision, and their time may stop between requests."""


class SimulatedOptions(Entry):
    """Options `port` and `token` of the process; by default, the values stored in the cell's folder."""

    port: Annotated[int, Field(gt=0, lt=2**16)] | None = None
    token: str | None = None


class _State(Entry):
    """The reply with a state."""

    stamp_s: Number
    joints_rad: Annotated[list[Number], Field(min_length=1, max_length=MOST_JOINTS)]


class _Image(Entry):
    """The reply with an image."""

    stamp_s: Number
    png_base64: str


def _parse_answer(kind: type[_Answer], answer: dict[str, Any]) -> _Answer:
    """Validate a reply, because any program may listen at the port.

    Raises:
        DriverError: if the reply is invalid.
    """
    try:
        return kind.model_validate(answer)
    except ValidationError as error:
        problem = first_problem(error, kind)
        raise DriverError(f"the program at that port is not a simulated cell ({problem})") from None


class SimulatedRobot:
    """An arm of a running cell."""

    is_live = True

    def __init__(self, name: str, cell: Connection) -> None:
        self._name, self._cell = name, cell

    def state(self) -> Reading:
        """Return the robot's next state.

        Raises:
            DriverError: if the cell does not answer.
        """
        answer = _parse_answer(_State, self._cell.ask(do="state", robot=self._name))
        return Reading(answer.stamp_s, RobotState(joints_rad=np.array(answer.joints_rad)))

    def move(self, to: RobotState, speed_rad_s: float) -> None:
        """Start a motion to joints.

        Raises:
            DriverError: if the joints are beyond their limits, or the goal is a pose.
        """
        if to.joints_rad is None:
            raise DriverError(f"{self._name} accepts goals as joints, not as poses of its flange")
        self._cell.ask(do="move", robot=self._name, joints_rad=to.joints_rad.tolist(), speed_rad_s=speed_rad_s)

    def stop(self) -> None:
        """Stop the robot."""
        self._cell.ask(do="stop", robot=self._name)

    def close(self) -> None:
        """Close the connection."""
        self._cell.close()


class SimulatedCamera:
    """A camera of a running cell, and the LED in its view."""

    is_live = True
    is_on_demand = True

    def __init__(self, name: str, cell: Connection) -> None:
        self._name, self._cell = name, cell

    def image(self) -> CameraImage:
        """Return the camera's next image.

        Raises:
            DriverError: if the cell does not answer.
        """
        answer = _parse_answer(_Image, self._cell.ask(do="image", camera=self._name))
        try:
            grey = grey_image(base64.b64decode(answer.png_base64), None)
        except ValueError:
            grey = "is not written as base64"
        if isinstance(grey, str):
            raise DriverError(f"{self._name}: an image {grey}")
        return CameraImage(answer.stamp_s, grey)

    def light(self, on: bool) -> None:
        """Switch the LED on or off."""
        self._cell.ask(do="light", on=on)

    def close(self) -> None:
        """Close the connection."""
        self._cell.close()


def reaches(place: Place) -> str:
    """Description of the local port at which the cell listens.

    Raises:
        DatasetError: if an option is wrong.
        DriverError: if no simulated cell is running.
    """
    return describe_address(_address(place))


def open_robot(place: Place) -> SimulatedRobot:
    """Connect to an arm of a running cell.

    Raises:
        DatasetError: if an option is wrong.
        DriverError: if no simulated cell is running.
    """
    return SimulatedRobot(place.name, _open_connection(place))


def open_camera(place: Place) -> SimulatedCamera:
    """Connect to a camera of a running cell.

    Raises:
        DatasetError: if an option is wrong.
        DriverError: if no simulated cell is running.
    """
    return SimulatedCamera(place.name, _open_connection(place))


def _open_connection(place: Place) -> Connection:
    return connect(_address(place))


def _address(place: Place) -> Address:
    options = checked_options(place, SimulatedOptions)
    if options.port is not None and options.token is not None:
        return Address(port=options.port, token=options.token, pid=0)
    return read_address(place.folder)
