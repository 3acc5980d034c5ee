"""A driver measured in a process of its own: what crashes or hangs a vendor's library ends that process alone."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from contextlib import closing
from dataclasses import asdict, dataclass, field, replace
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
from basecal.acquisition.rig import openers
from basecal.box import BoxError, Frame, frames
from basecal.cell import Cell, CellCamera, Robot
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


def check_opener(check: DriverCheck) -> tuple[DriverKind, Place]:
    """The driver and place of the robot or camera to measure.

    Raises:
        UsageError: if the cell has none of that name.
        InputError: if there is no such cell, and no such driver.
    """
    if not check.is_in_cell:
        return _opener_without_cell(check)
    found = {place.name: (kind, place) for kind, place in openers(read_cell(check.device), Path(check.device))}
    if check.name not in found:
        known = ", ".join(found) or "none"
        raise UsageError(
            f"no robot or camera {check.name!r} with a driver{nearest(check.name, found)}; there are: {known}"
        )
    kind, place = found[check.name]
    return kind, replace(place, allow_plaintext=check.allow_plaintext)


def _opener_without_cell(check: DriverCheck) -> tuple[DriverKind, Place]:
    """A driver of which no cell says anything, in a cell of its own."""
    kind, known = driver_kind(check.device), driver_names()
    if kind is None:
        hint = nearest(check.device, known)
        raise InputError(f"no driver and no cell {check.device!r}{hint}; drivers are: {', '.join(known)}")
    if (kind.open_camera if check.is_camera else kind.open_robot) is None:
        raise InputError(f"no driver of that name is for {'cameras' if check.is_camera else 'robots'}")
    cameras = {"camera": CellCamera("camera", "world")} if check.is_camera else {}
    cell = Cell("robot", {"robot": Robot("robot")}, cameras=cameras)
    return kind, Place("camera" if check.is_camera else "robot", cell, Path("."), check.options)


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
    kind, place = check_opener(check)
    if place.name in place.cell.cameras:
        with closing(kind.camera(place)) as camera:
            yield from camera_promises(camera)
        return
    with closing(kind.robot(place)) as robot:
        yield from robot_promises(place.name, robot, kind.stop_guarantee, check.go)
        if check.cut:
            yield f"Cut the connection of {place.name} now, for three seconds, and restore it."
            yield reconnection_promise(place.name, robot, _CUT_S)
