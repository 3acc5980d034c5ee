"""Tests of UR controllers in separate processes, through ur-rtde's client."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import pytest

from basecal.acquisition.driver import Freedrives, Moves, Place
from basecal.acquisition.driver_check.promises import measure_stop
from basecal.acquisition.drivers.ur import open_robot
from basecal.acquisition.rig import open_rig
from basecal.cell import Cell, Driver, Robot, RobotState
from basecal.errors import DatasetError, DriverError
from shared.second_process import own_host
from shared.ur_place import CELL, controller

pytest.importorskip("rtde_receive")

pytestmark = pytest.mark.timed


def test_two_controllers_with_their_own_clocks(tmp_path):
    """A cell file opens two controllers, and each reports its place."""
    with controller() as (first, one), controller("50") as (_, other):
        robots = {
            name: Robot(name, driver=Driver("ur", place().options)) for name, place in (("left", one), ("right", other))
        }
        first.tell("turn", 0.25)
        with open_rig(Cell("left", robots), tmp_path) as rig:
            states = {name: robot.state() for name, robot in rig.robots.items()}
    assert abs(states["left"].stamp_s - states["right"].stamp_s) > 40
    assert states["left"].state.base_from_flange.rotation[0, 0] == pytest.approx(np.cos(0.25))
    assert states["right"].state.base_from_flange.rotation[0, 0] == 1.0


def test_arm_moves_within_the_speed_limit(there):
    """It arrives, no joint exceeds the limit, and no program ran before the motion."""
    process, place = there
    robot = open_robot(place())
    assert isinstance(robot, Moves)
    robot.stop()
    assert process.tell("tell").split()[2:] == []
    goal = np.array([0.1, -1.45, 1.5, 0.0, 0.5, 0.2])
    robot.move(RobotState(joints_rad=goal), 0.8)
    until = time.monotonic() + 3
    while np.abs(robot.state().state.joints_rad - goal).max() > 1e-12 and time.monotonic() < until:
        robot.keep_alive()
    np.testing.assert_allclose(robot.state().state.joints_rad, goal, atol=1e-12)
    assert float(process.tell("tell").split()[0]) == pytest.approx(0.8, rel=1e-6)
    with pytest.raises(DriverError, match="eye: the goal is beyond the safety limits of the controller"):
        robot.move(RobotState(joints_rad=np.full(6, 7.0)), 0.8)
    robot.close()


def test_arm_stops_during_a_motion(there):
    """After a stop it is at rest within a few states, far from its goal."""
    _, place = there
    robot = open_robot(place())
    robot.move(RobotState(joints_rad=np.array([3.0, -1.5, 1.5, 0.0, 0.5, 0.0])), 0.5)
    time.sleep(0.1)
    robot.stop()
    joints = [robot.state().state.joints_rad[0] for _ in range(10)]
    assert 0.01 < joints[-1] < 0.5
    assert joints[-1] == joints[5]
    robot.close()


def test_driver_check_measures_the_watchdog(there):
    """The stop is visible in the states: without heartbeats, an ended program is no error."""
    _, place = there
    robot = open_robot(place())
    stop = measure_stop("eye", robot, np.radians(3), np.radians(5), "silence")
    assert 0.1 < stop.time_s < 0.5
    robot.keep_alive()
    with pytest.raises(DriverError, match="the program on the controller was stopped"):
        robot.state()
    robot.close()


@pytest.mark.slow
def test_robot_without_urdf_moves_by_poses():
    """It reports and accepts poses of its tool centre point."""
    with controller() as (_, place):
        robot = open_robot(Place("arm", Cell("arm", {"arm": Robot("arm")}), Path("."), place().options))
        pose = robot.state().state.base_from_flange
        np.testing.assert_allclose(pose.translation, [0.1, 0.2, 0.3])
        turned = type(pose)(np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]), pose.translation)
        robot.move(RobotState(turned), 50.0)
        for _ in range(200):
            robot.keep_alive()
            reached = robot.state().state.base_from_flange
        np.testing.assert_allclose(reached.rotation, turned.rotation, atol=1e-9)
        robot.close()


def test_freedrive_begins_and_ends(there):
    """The arm cannot be moved by goals meanwhile."""
    process, place = there
    robot = open_robot(place(motion="freedrive"))
    assert isinstance(robot, Freedrives)
    assert not isinstance(robot, Moves)
    led = []
    for on in (True, False):
        robot.freedrive(on)
        led.append(process.tell("tell").split()[1])
    assert led == ["1", "0"]
    robot.close()


def test_missing_controller_and_wrong_option_are_reported(tmp_path):
    """One line names the cause."""
    with pytest.raises(DriverError, match=r"eye: nothing listens at .*:30004: is a UR controller running there"):
        open_robot(Place("eye", CELL, tmp_path, {"host": own_host()}))
    with pytest.raises(DatasetError, match=r"robots\.eye\.driver\.host"):
        open_robot(Place("eye", CELL, tmp_path, {}))
    with pytest.raises(DatasetError, match=r"robots\.eye\.driver\.motion"):
        open_robot(Place("eye", CELL, tmp_path, {"host": "10.0.0.2", "motion": "fly"}))
