"""Tests of robots with OPC UA in separate processes."""

from __future__ import annotations

import signal
import threading
import time
from pathlib import Path

import numpy as np
import pytest

from basecal.acquisition.driver import Moves, Place
from basecal.acquisition.drivers.opcua import open_robot
from basecal.cell import Cell, Robot
from basecal.errors import DatasetError, DriverError
from basecal.exchange.controllers.registry import CONTROLLERS
from shared import opcua_place
from shared.needed import needed
from shared.network import network

needed("asyncua", "opcua")
DEGREES = np.array([10.0, -90.0, 90.0, 0.0, 30.0, 5.0])


def test_joints_follow_the_companion_specification(opcua_robot):
    """Without named nodes, the axes of the only motion device are read by number, in their stated unit."""
    place = opcua_robot.place
    robot = open_robot(place())
    assert not isinstance(robot, Moves)
    np.testing.assert_allclose(robot.state().state.joints_rad, np.radians(DEGREES))
    opcua_robot.tell("turn", 1.5)
    turned = robot.state()
    np.testing.assert_allclose(turned.state.joints_rad, np.radians(DEGREES + 1.5))
    opcua_robot.tell("turn", 0)
    assert robot.state().stamp_s > turned.stamp_s > 1.6e9
    robot.close()


@pytest.mark.parametrize("path", ["ns=2;s=joints", "Own/Joints", "Objects/Own/Joints"])
def test_nodes_can_be_named(opcua_robot, path):
    """A node with all joints is named by id or browse path; the cell states its unit."""
    robot = open_robot(opcua_robot.place(joints=path, unit="rad"))
    np.testing.assert_array_equal(robot.state().state.joints_rad, np.full(6, 0.1))
    robot.close()


def test_pose_is_read_in_its_convention(opcua_robot):
    """A robot without URDF yields the pose of a node in the maker's convention."""
    options = opcua_robot.place(pose="Own/Pose", notation="kuka").options
    robot = open_robot(Place("arm", Cell("arm", {"arm": Robot("arm")}), Path("."), options))
    wanted = CONTROLLERS["kuka"].read(np.array([100.0, 200, 300, 10, 20, 30]))
    np.testing.assert_allclose(robot.state().state.base_from_flange.matrix, wanted.matrix)
    robot.close()


def test_wrong_number_of_joints_is_an_error(opcua_robot):
    """Five numbers for six joints are reported, and never used as a state."""
    place = opcua_robot.place
    robot = open_robot(place(joints="Own/Joints", unit="rad"))
    opcua_robot.tell("few")
    with pytest.raises(DriverError, match="eye: the nodes hold 5 numbers, expected 6"):
        robot.state()
    robot.close()


@pytest.mark.journey
def test_values_that_change_under_one_stamp_are_refused(opcua_robot):
    """They would be paired wrongly with images."""
    opcua_robot.tell("turn_unstamped", 0)
    robot = open_robot(opcua_robot.place())
    robot.state()
    opcua_robot.tell("turn_unstamped", 1)
    with pytest.raises(DriverError, match=r"eye: stale stamps: \d+ states came, none with a stamp newer"):
        robot.state()
    robot.close()


def test_joints_need_a_urdf(tmp_path):
    """A robot without a URDF can only yield a pose."""
    with pytest.raises(DatasetError, match=r"robots\.arm\.driver: joints need urdf"):
        open_robot(Place("arm", Cell("arm", {"arm": Robot("arm")}), tmp_path, {"url": "opc.tcp://10.0.0.2"}))


@pytest.mark.slow
def test_lost_session_is_re_established(opcua_robot):
    """After a break a new session continues the states; if it fails, the error comes after the reconnection time."""
    with network("127.0.0.1", opcua_robot.port) as (net, port):
        robot = open_robot(opcua_robot.place(url=f"opc.tcp://127.0.0.1:{port}/robot"))
        before = robot.state()
        net.cut()
        np.testing.assert_array_equal(robot.state().state.joints_rad, before.state.joints_rad)
        net.refuses = True
        net.cut()
        with pytest.raises(DriverError, match=r"eye: the server .*; tried again for 1 s"):
            robot.state()


@pytest.mark.parametrize(("degrees", "problem"), [("nan", "a number is not finite"), ("1e308", "joint . is at 1.*rad")])
def test_implausible_numbers_are_refused(opcua_robot, degrees, problem):
    """NaN or 1e308 from a server is refused with the number."""
    robot = open_robot(opcua_robot.place())
    opcua_robot.tell("turn", degrees)
    with pytest.raises(DriverError, match=f"eye: implausible state: {problem}"):
        robot.state()
    robot.close()


@pytest.mark.slow
def test_frozen_or_killed_server_is_reported():
    """States of a paused process continue; a killed one ends in an error in time."""
    with opcua_place.opcua_robot() as process:
        robot = open_robot(process.place(reconnect_s=6.0))
        robot.state()
        process.process.send_signal(signal.SIGSTOP)
        threading.Timer(2.0, process.process.send_signal, [signal.SIGCONT]).start()
        assert robot.state().state.joints_rad.shape == (6,)
        process.process.kill()
        began_s = time.monotonic()
        with pytest.raises(DriverError, match=r"eye: nothing listens at .*; tried again for 6 s"):
            robot.state()
        assert 6 < time.monotonic() - began_s < 20
