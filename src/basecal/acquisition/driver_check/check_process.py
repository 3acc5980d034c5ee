"""Measurement of a driver in a separate process: a crash or hang of a vendor's library affects only that process."""

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
from basecal.errors import DriverError, InputError, UsageError, spelling_hint

_CUT_S = 20.0  # for a person to cut a connection and to restore it
_IMAGES_BYTES = 2**28  # file size that determines the limits of processor time and memory, which images need
_SILENCE_S = 60.0  # timeout for a hanging driver: it measures for 5 s, and connects in less than 10 s
_STOP_S = 1.0  # for an arm to stop after an interrupt


@dataclass(frozen=True)
class DriverCheck:
    """Settings of a driver check: a robot or camera of a cell, or a driver's name and options.

    Attributes:
        device: Folder of a cell, or name of a driver.
        name: Name of the robot or camera in the cell.
        options: Options of a driver without a cell.
        is_camera: Whether a driver without a cell is for a camera.
        go: Whether to move the arm.
        cut: Whether a person cuts the connection.
        allow_plaintext: Whether passwords may be sent without encryption.
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
        """Whether `device` is a cell's folder."""
        return (Path(self.device) / "cell.yaml").is_file()


def find_opener(check: DriverCheck) -> tuple[DriverKind, Place]:
    """The driver and place of the robot or camera to measure.

    Raises:
        UsageError: if the cell has no robot or camera of that name with a driver.
        InputError: if neither a cell nor a driver of that name exists.
    """
    if not check.is_in_cell:
        return _opener_without_cell(check)
    openers_by_name = {
        place.name: (kind, place) for kind, place in openers(read_cell(check.device), Path(check.device))
    }
    if check.name not in openers_by_name:
        hint, known = spelling_hint(check.name, openers_by_name), ", ".join(openers_by_name)
        if not openers_by_name:
            raise UsageError("no robot or camera has a `driver`: add it to cell.yaml (docs/data_format.md)")
        if not check.name:
            raise UsageError(f"give the robot or camera after the cell's folder; there are: {known}")
        raise UsageError(f"no robot or camera {check.name!r} with a driver{hint}; there are: {known}")
    kind, place = openers_by_name[check.name]
    return kind, replace(place, allow_plaintext=check.allow_plaintext)


def _opener_without_cell(check: DriverCheck) -> tuple[DriverKind, Place]:
    """A driver without a cell, with a minimal cell for it."""
    kind, known = driver_kind(check.device), driver_names()
    if kind is None:
        hint = spelling_hint(check.device, known)
        raise InputError(f"no driver and no cell {check.device!r}{hint}; drivers are: {', '.join(known)}")
    if (kind.open_camera if check.is_camera else kind.open_robot) is None:
        raise InputError(f"no driver of that name is for {'cameras' if check.is_camera else 'robots'}")
    cameras = {"camera": CellCamera("camera", "world")} if check.is_camera else {}
    cell = Cell("robot", {"robot": Robot("robot")}, cameras=cameras)
    return kind, Place("camera" if check.is_camera else "robot", cell, Path("."), check.options)


def measure_promises(check: DriverCheck) -> Iterator[Promise | str]:
    """Run the check in a separate process; promises as they are measured, and instructions for the user.

    Raises:
        DriverError: if the driver does not answer, or its process ends.
        InputError: if the driver does not exist.
    """
    arguments = [json.dumps(asdict(check))]
    try:
        for message, _ in frames(__name__, arguments, _IMAGES_BYTES, ending_s=_STOP_S, silence_s=_SILENCE_S):
            yield message if isinstance(message, str) else Promise(**message)
    except BoxError as error:
        raise DriverError(f"{check.name or check.device}: its driver {error}") from None


def read_frames(arguments: Sequence[str]) -> Iterator[Frame]:
    """Run the check inside the separate process; a frame for each promise and each instruction.

    Raises:
        BasecalError: the error of the driver.
    """
    for message in _measure(DriverCheck(**json.loads(arguments[0]))):
        yield message if isinstance(message, str) else vars(message), b""


def _measure(check: DriverCheck) -> Iterator[Promise | str]:
    kind, place = find_opener(check)
    if place.name in place.cell.cameras:
        with closing(kind.camera(place)) as camera:
            yield from camera_promises(camera)
        return
    with closing(kind.robot(place)) as robot:
        if robot.is_live:
            place.check_joints(robot.state().state)
        yield from robot_promises(place.name, robot, kind.stop_guarantee, check.go)
        if check.cut:
            yield f"Cut the connection of {place.name} now, for three seconds, and restore it."
            yield reconnection_promise(place.name, robot, _CUT_S)
