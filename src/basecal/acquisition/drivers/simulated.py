"""The arms and cameras of a simulated cell that runs in a process of its own (`basecal simulate CELL --process`)."""

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
    place_words,
    read_address,
)
from basecal.vision.image_file import grey_image

_Answer = TypeVar("_Answer", bound=Entry)


STOP_GUARANTEE: StopGuarantee = "watchdog"

NEEDS_OWN_PROCESS = False
"""A simulated arm hurts nobody, and its time may stand still while nobody asks."""


class SimulatedOptions(Entry):
    """`port` and `token` of the process; where they are left out, those in the cell's folder."""

    port: Annotated[int, Field(gt=0, lt=2**16)] | None = None
    token: str | None = None


class _State(Entry):
    """Its answer to a request of a state."""

    stamp_s: Number
    joints_rad: Annotated[list[Number], Field(min_length=1, max_length=MOST_JOINTS)]


class _Image(Entry):
    """The reply with an image."""

    stamp_s: Number
    png_base64: str


def _parse_answer(kind: type[_Answer], answer: dict[str, Any]) -> _Answer:
    """An answer, whoever gave it: any program may listen at a port.

    Raises:
        DriverError: if it is none.
    """
    try:
        return kind.model_validate(answer)
    except ValidationError as error:
        said = first_problem(error, kind)
        raise DriverError(f"what answers at that port is no simulated cell ({said})") from None


class SimulatedRobot:
    """An arm of a running cell."""

    is_live = True

    def __init__(self, name: str, cell: Connection) -> None:
        self._name, self._cell = name, cell

    def state(self) -> Reading:
        """Its next state.

        Raises:
            DriverError: if the cell does not answer.
        """
        answer = _parse_answer(_State, self._cell.ask(do="state", robot=self._name))
        return Reading(answer.stamp_s, RobotState(joints_rad=np.array(answer.joints_rad)))

    def move(self, to: RobotState, speed_rad_s: float) -> None:
        """Send it to joints.

        Raises:
            DriverError: if they are beyond its limits, or a pose is requested.
        """
        if to.joints_rad is None:
            raise DriverError(f"{self._name} goes to joints, not to poses of its flange")
        self._cell.ask(do="move", robot=self._name, joints_rad=to.joints_rad.tolist(), speed_rad_s=speed_rad_s)

    def stop(self) -> None:
        """Have it come to rest."""
        self._cell.ask(do="stop", robot=self._name)

    def close(self) -> None:
        """Hang up."""
        self._cell.close()


class SimulatedCamera:
    """A camera of a running cell, and the light it looks at."""

    is_live = True
    is_on_demand = True

    def __init__(self, name: str, cell: Connection) -> None:
        self._name, self._cell = name, cell

    def image(self) -> CameraImage:
        """Its next image.

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
        """Switch the light."""
        self._cell.ask(do="light", on=on)

    def close(self) -> None:
        """Hang up."""
        self._cell.close()


def reaches(place: Place) -> str:
    """The port of this computer at which the cell listens.

    Raises:
        DatasetError: if an option is wrong.
        DriverError: if no cell runs.
    """
    return place_words(_address(place))


def open_robot(place: Place) -> SimulatedRobot:
    """An arm, with a line to its cell.

    Raises:
        DatasetError: if an option is wrong.
        DriverError: if no cell runs.
    """
    return SimulatedRobot(place.name, _open_connection(place))


def open_camera(place: Place) -> SimulatedCamera:
    """A camera, with a line to its cell.

    Raises:
        DatasetError: if an option is wrong.
        DriverError: if no cell runs.
    """
    return SimulatedCamera(place.name, _open_connection(place))


def _open_connection(place: Place) -> Connection:
    return connect(_address(place))


def _address(place: Place) -> Address:
    options = checked_options(place, SimulatedOptions)
    if options.port is not None and options.token is not None:
        return Address(port=options.port, token=options.token, pid=0)
    return read_address(place.folder)
