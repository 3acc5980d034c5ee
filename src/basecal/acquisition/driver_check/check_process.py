"""A driver measured in a process of its own: what crashes or hangs a vendor's library ends that process alone."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from contextlib import closing
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from basecal.acquisition.driver import DriverKind, Place
from basecal.acquisition.driver_check.promises import (
    Promise,
    camera_promises,
    reconnection_promise,
    robot_promises,
)
from basecal.acquisition.drivers.registry import driver_kind, driver_names
from basecal.box import BoxError, Frame, frames
from basecal.cell import Cell, CellCamera, Driver, Robot
from basecal.cell.files import read_cell
from basecal.errors import DriverError, InputError, UsageError, nearest

_CUT_S = 20.0  # that a person has to cut a connection and to restore it
_IMAGES_BYTES = 2**28  # as of a file so large: time of the processor, and memory for images
_SILENCE_S = 60.0  # of a driver whose library waits for ever: it measures for five, and connects in less than ten
_STOP_S = 1.0  # that an arm has to be stopped if a person interrupts


@dataclass(frozen=True)
class DriverCheck:
    """The checked driver: a robot or camera of a cell, or a driver by its name and options.

    Attributes:
        device: Folder of a cell, or the name of a driver.
        name: The robot or camera of the cell.
        options: Of a driver that is named.
        is_camera: Whether the driver that is named is that of a camera.
        go: Whether the arm is moved.
        cut: Whether a person cuts the connection.
        allow_plaintext: Whether passwords go without encryption.
    """

    device: str
    name: str = ""
    options: dict[str, Any] = field(default_factory=dict)
    is_camera: bool = False
    go: bool = False
    cut: bool = False
    allow_plaintext: bool = False

    @property
    def is_in_cell(self) -> bool:
        """Whether the device is a cell's folder."""
        return (Path(self.device) / "cell.yaml").is_file()


def check_place(check: DriverCheck) -> Place:
    """The robot or camera to measure.

    Raises:
        UsageError: if the cell has none of that name.
        InputError: if there is no such cell, and no such driver.
    """
    if check.is_in_cell:
        return _place_in_cell(check)
    known = driver_names()
    if check.device not in known:
        hint = nearest(check.device, known)
        raise InputError(f"no driver and no cell {check.device!r}{hint}; drivers are: {', '.join(known)}")
    driver = Driver(check.device, check.options)
    if check.is_camera:
        cameras = {"camera": CellCamera("camera", "world", driver=driver)}
        cell = Cell("robot", {"robot": Robot("robot")}, cameras=cameras)
        return Place("camera", cell, Path("."), driver.options)
    return Place("robot", Cell("robot", {"robot": Robot("robot", driver=driver)}), Path("."), driver.options)


def _place_in_cell(check: DriverCheck) -> Place:
    cell, folder = read_cell(check.device), Path(check.device)
    things = {each: robot.driver for each, robot in cell.robots.items() if robot.driver}
    things |= {each: camera.driver for each, camera in cell.cameras.items() if camera.driver}
    if check.name not in things:
        known = ", ".join(things) or "none"
        raise UsageError(
            f"no robot or camera {check.name!r} with a driver{nearest(check.name, things)}; there are: {known}"
        )
    return Place(check.name, cell, folder, things[check.name].options, check.allow_plaintext)


def measured_promises(check: DriverCheck) -> Iterator[Promise | str]:
    """Promises as they are measured, and what a person is to do.

    Raises:
        DriverError: if the driver does not answer, or ends its process.
        InputError: if there is no such driver.
    """
    words = [json.dumps(asdict(check))]
    try:
        for said, _ in frames(__name__, words, _IMAGES_BYTES, ending_s=_STOP_S, silence_s=_SILENCE_S):
            yield said if isinstance(said, str) else Promise(**said)
    except BoxError as error:
        raise DriverError(f"{check.name or check.device}: its driver {error}") from None


def read_frames(words: Sequence[str]) -> Iterator[Frame]:
    """Frames of the box: each promise, and each thing to do.

    Raises:
        BasecalError: as the driver does.
    """
    for each in _measure(DriverCheck(**json.loads(words[0]))):
        yield each if isinstance(each, str) else vars(each), b""


def _measure(check: DriverCheck) -> Iterator[Promise | str]:
    place = check_place(check)
    is_robot = place.name in place.cell.robots
    kind = _kind(place, is_robot)
    if not is_robot:
        with closing(kind.camera(place)) as camera:
            yield from camera_promises(camera)
        return
    with closing(kind.robot(place)) as robot:
        yield from robot_promises(place.name, robot, kind.stop_guarantee, check.go)
        if check.cut:
            yield f"Cut the connection of {place.name} now, for three seconds, and restore it."
            yield reconnection_promise(place.name, robot, _CUT_S)


def _kind(place: Place, is_robot: bool) -> DriverKind:
    driver = (place.cell.robots if is_robot else place.cell.cameras)[place.name].driver
    kind = None if driver is None else driver_kind(driver.kind)
    if kind is None or (kind.open_robot if is_robot else kind.open_camera) is None:
        raise InputError(f"no driver of that name is for {'robots' if is_robot else 'cameras'}")
    return kind
