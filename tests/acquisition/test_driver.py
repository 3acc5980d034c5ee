"""Tests of the interfaces of drivers, and of their options."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from basecal.acquisition.driver import (
    ARRIVED_RAD_M,
    PATH_TOLERANCE_RAD,
    Camera,
    DriverKind,
    Freedrives,
    Moves,
    Place,
    Reading,
    Robot,
    Switches,
    check_reading,
    checked_options,
    has_arrived,
    largest_path_deviation,
)
from basecal.acquisition.drivers.folder import FolderOptions
from basecal.acquisition.drivers.replay import ReplayCamera, ReplayRobot
from basecal.acquisition.drivers.typed import TypedRobot
from basecal.cell import Cell, RobotState
from basecal.cell import Robot as CellRobot
from basecal.errors import DatasetError, DriverError
from basecal.geometry import SE3
from basecal.simulation.arms import six_axis

CELL = Cell("eye", {"eye": CellRobot("eye")})


def place(**options):
    return Place("wrist", CELL, Path("mycell"), options)


def test_interfaces_show_the_abilities_of_a_driver():
    """A typed robot can neither move nor be guided; a replayed one moves, and its camera can switch an LED."""
    typed, robot, camera = TypedRobot(place(), "ur"), ReplayRobot("eye", None), ReplayCamera("wrist", None)
    assert [isinstance(typed, face) for face in (Robot, Moves, Freedrives)] == [True, False, False]
    assert [isinstance(robot, face) for face in (Robot, Moves, Freedrives)] == [True, True, False]
    assert [isinstance(camera, face) for face in (Camera, Switches, Robot)] == [True, True, False]


def test_options_are_checked():
    """Known options are accepted; for an unknown one the error has file, field and the nearest known option."""
    assert checked_options(place(path="images", wait_s=2.0), FolderOptions).wait_s == 2.0
    with pytest.raises(DatasetError, match=r"mycell/cell\.yaml: cameras\.wrist\.driver\.pth: .*did you mean 'path'"):
        checked_options(place(pth="images"), FolderOptions)


def test_error_in_options_names_the_line(tmp_path):
    """The line is that of the option in `cell.yaml`, or of its driver if an option is missing."""
    (tmp_path / "cell.yaml").write_text("cameras:\n  wrist:\n    driver:\n      kind: folder\n      pth: images\n")
    known = Place("wrist", CELL, tmp_path, {"pth": "images"})
    with pytest.raises(DatasetError, match=r"cell\.yaml:5: cameras\.wrist\.driver\.pth: unknown field") as caught:
        checked_options(known, FolderOptions)
    assert caught.value.line == 3
    assert "missing" in str(caught.value)
    assert str(known.error("no", "driver.kind")).endswith("cell.yaml:4: cameras.wrist.driver.kind: no")


def test_joints_are_those_of_the_chain():
    """Another number of them is refused with their names; a pose, and joints of a robot without a URDF, are not."""
    chain = six_axis()
    known = Place("eye", Cell("eye", {"eye": CellRobot("eye", chain=chain)}), Path("mycell"))
    three, six = (RobotState(joints_rad=np.zeros(count)) for count in (3, 6))
    for state in (six, RobotState(SE3.identity())):
        known.check_joints(state)
    Place("eye", CELL, Path("mycell")).check_joints(three)
    names = ", ".join(chain.joint_names)
    with pytest.raises(DriverError, match=f"^eye: its driver reports 3 joints, .* has 6: {names}. Report these"):
        known.check_joints(three)


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (RuntimeError("No device connected"), "wrist: its driver failed (RuntimeError: No device connected)"),
        (DriverError("wrist: unplugged"), "wrist: unplugged"),
    ],
)
def test_device_that_does_not_open_is_named(error, words):
    """An error of a maker's library names the robot or camera; an error of this package is unchanged."""

    def fail(place):
        raise error

    kind = DriverKind(fail, fail)
    for open_device in (kind.robot, kind.camera):
        with pytest.raises(DriverError) as raised:
            open_device(place())
        assert str(raised.value) == words


def test_arm_has_arrived_within_two_milliradians():
    """Just inside the limit it has arrived, just outside not; one joint decides."""
    goal = RobotState(joints_rad=np.zeros(3))
    for off, arrived in ((0.99, True), (1.01, False)):
        state = RobotState(joints_rad=np.array([0.0, off * ARRIVED_RAD_M, 0.0]))
        assert has_arrived(state, goal) is arrived


def test_joint_leaves_its_path_beyond_start_or_goal():
    """Any value between both is on the path; the joint that is farthest outside is reported."""
    start, goal = np.array([0.0, 1.0]), np.array([1.0, 0.0])
    for fine in ([0.0, 1.0], [0.9, 0.9], [1.0 + 0.99 * PATH_TOLERANCE_RAD, -0.99 * PATH_TOLERANCE_RAD]):
        assert largest_path_deviation(np.array(fine), start, goal, PATH_TOLERANCE_RAD) is None
    joint, beyond_rad = largest_path_deviation(np.array([1.1, -0.2]), start, goal, PATH_TOLERANCE_RAD)
    assert (joint, round(beyond_rad, 9)) == (1, 0.2)


def joints(*values):
    return Reading(1.0, RobotState(joints_rad=np.array(values, dtype=float)))


def pose(x_m, scale=1.0):
    return Reading(1.0, RobotState(SE3.adopt(scale * np.eye(3), np.array([x_m, 0.0, 0.0]))))


@pytest.mark.parametrize("reading", [joints(0.1, -999.0), pose(999.0), Reading(-5.0, joints(0.0).state)])
def test_plausible_reading_is_accepted(reading):
    """Joints of many turns, far flanges and negative stamps are plausible."""
    check_reading("eye", reading)


@pytest.mark.parametrize(
    ("reading", "problem"),
    [
        (joints(0.1, np.nan), "a number is not finite"),
        (joints(np.inf), "a number is not finite"),
        (joints(), "it has no joints"),
        (joints(0.0, 1e308), r"joint 2 is at 1e\+308 rad"),
        (joints(0.0, -1001.0), r"joint 2 is at -1e\+03 rad"),
        (pose(1001.0), r"the flange is 1e\+03 m from its base"),
        (pose(np.nan), "a number is not finite"),
        (pose(0.0, 2.0), "its rotation matrix is not orthonormal"),
        (Reading(np.nan, joints(0.0).state), "its stamp is nan"),
        (Reading(0.0, RobotState()), "expected either joints or a pose"),
    ],
)
def test_implausible_reading_is_refused_with_its_number(reading, problem):
    """The error has the robot and the number."""
    with pytest.raises(DriverError, match=f"eye: implausible state: {problem}"):
        check_reading("eye", reading)
