"""Robot states that a person types or pastes from a pendant, in the notation of the robot's manufacturer."""

from __future__ import annotations

import re
import sys
import time
from typing import Annotated, TextIO

import numpy as np

from basecal.acquisition.driver import Place, Reading, checked_options
from basecal.cell import RobotState
from basecal.errors import DriverError, InputError, count_text
from basecal.exchange.controllers.registry import CONTROLLERS
from basecal.fields.values import LARGEST_VALUE, Entry, known_name_validator

_NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")
_JOINTS = {"joints_deg": np.radians(1.0), "joints_rad": 1.0}  # [rad] per typed unit
_NOTATIONS = (*CONTROLLERS, *_JOINTS)


NEEDS_OWN_PROCESS = False
"""The driver reads from the terminal."""


class TypedOptions(Entry):
    """Option `notation`: the controller whose convention typed poses follow, or `joints_deg` or `joints_rad`."""

    notation: Annotated[str, known_name_validator("notation", _NOTATIONS)] = "ur"


class TypedRobot:
    """A robot whose state a person types."""

    is_live = False

    def __init__(self, place: Place, notation: str, source: TextIO | None = None) -> None:
        self._place, self._notation, self._source = place, notation, source

    def state(self) -> Reading:
        """Prompt for a state; an invalid line is reported and requested again.

        Raises:
            DriverError: if the input has ended.
        """
        source = self._source or sys.stdin
        while True:
            print(f"{self._place.name}, {self._notation}: ", end="", file=sys.stderr, flush=True)
            line = source.readline()
            if not line:
                raise DriverError(f"{self._place.name}: the input has ended")
            try:
                return Reading(time.monotonic(), self._read(line))
            except InputError as error:
                print(error, file=sys.stderr)

    def _read(self, line: str) -> RobotState:
        numbers = np.array([float(each) for each in _NUMBER.findall(line)])
        names = self._names()
        if not np.all(np.abs(numbers) <= LARGEST_VALUE):
            raise InputError(f"a number is beyond {LARGEST_VALUE:g}")
        if len(numbers) != len(names):
            raise InputError(f"{count_text(len(numbers), 'number')}, expected {len(names)}: {' '.join(names)}")
        if self._notation in _JOINTS:
            return RobotState(joints_rad=_JOINTS[self._notation] * numbers)
        return RobotState(CONTROLLERS[self._notation].read(numbers))

    def _names(self) -> tuple[str, ...]:
        if self._notation not in _JOINTS:
            return CONTROLLERS[self._notation].names
        chain = self._place.cell.robots[self._place.name].chain
        if chain is None:
            raise InputError("joints need urdf, base_link and flange_link of the robot in cell.yaml")
        return chain.joint_names

    def close(self) -> None:
        """Do nothing: there is nothing to close."""


def reaches(place: Place) -> str:
    """Empty: the driver accesses nothing outside the cell's folder."""
    return ""


def open_robot(place: Place) -> TypedRobot:
    """Open a robot whose states are typed on the standard input.

    Raises:
        DatasetError: if an option is wrong.
    """
    return TypedRobot(place, checked_options(place, TypedOptions).notation)
