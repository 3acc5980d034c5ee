"""The faces of drivers, and their options."""

from __future__ import annotations

from pathlib import Path

import pytest

from basecal.acquisition.driver import (
    Camera,
    DriverKind,
    Freedrives,
    Moves,
    Place,
    Robot,
    Switches,
    checked_options,
)
from basecal.acquisition.drivers.folder import FolderOptions
from basecal.acquisition.drivers.replay import ReplayCamera, ReplayRobot
from basecal.acquisition.drivers.typed import TypedRobot
from basecal.cell import Cell
from basecal.cell import Robot as CellRobot
from basecal.errors import DatasetError, DriverError

CELL = Cell("eye", {"eye": CellRobot("eye")})


def place(**options):
    return Place("wrist", CELL, Path("mycell"), options)


def test_faces_tell_what_a_driver_can():
    """A typed robot neither moves nor can be led; a replayed one moves, and its camera has a light."""
    typed, robot, camera = TypedRobot(place(), "ur"), ReplayRobot("eye", None), ReplayCamera("wrist", None)
    assert [isinstance(typed, face) for face in (Robot, Moves, Freedrives)] == [True, False, False]
    assert [isinstance(robot, face) for face in (Robot, Moves, Freedrives)] == [True, True, False]
    assert [isinstance(camera, face) for face in (Camera, Switches, Robot)] == [True, True, False]


def test_options_are_checked():
    """Those known are taken; an unknown one names the file, the field and the nearest known one."""
    assert checked_options(place(path="images", wait_s=2.0), FolderOptions).wait_s == 2.0
    with pytest.raises(DatasetError, match=r"mycell/cell\.yaml: cameras\.wrist\.driver\.pth: .*did you mean 'path'"):
        checked_options(place(pth="images"), FolderOptions)


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (RuntimeError("No device connected"), "wrist: its driver failed (RuntimeError: No device connected)"),
        (DriverError("wrist: unplugged"), "wrist: unplugged"),
    ],
)
def test_a_device_that_does_not_open_is_named(error, words):
    """An error of a maker's library names the robot or camera; one of ours stays as it is."""

    def fail(place):
        raise error

    kind = DriverKind(fail, fail)
    for open_device in (kind.robot, kind.camera):
        with pytest.raises(DriverError) as raised:
            open_device(place())
        assert str(raised.value) == words
