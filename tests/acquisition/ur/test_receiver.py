"""Tests of states of a UR controller in a separate process, through ur-rtde's client."""

from __future__ import annotations

import socket
import threading
import time
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from basecal.acquisition.driver import Freedrives, Moves, Place
from basecal.acquisition.drivers.ur import open_robot
from basecal.acquisition.ur.receiver import Receiver
from basecal.errors import DriverError
from shared.second_process import own_host
from shared.ur_place import CELL, controller

pytest.importorskip("rtde_receive")

pytestmark = pytest.mark.timed


def take(robot, count):
    """A number of states of a robot."""
    return [robot.state() for _ in range(count)]


def test_states_have_the_controllers_stamps(there):
    """Joints and stamp are of one state: this controller's last joint is a function of its stamp."""
    process, place = there
    robot = open_robot(place(motion="watch", rate_hz=500))
    assert not isinstance(robot, Moves)
    assert not isinstance(robot, Freedrives)
    process.tell("spin")
    readings = [robot.state() for _ in range(300)][100:]
    stamps = np.array([reading.stamp_s for reading in readings])
    assert np.all(np.diff(stamps) > 0)
    last = np.array([reading.state.joints_rad[5] for reading in readings])
    np.testing.assert_array_equal(last, stamps)
    robot.close()


@pytest.mark.parametrize(
    ("fault", "error"),
    [
        ("protective_stop", "eye: protective stop. Release it at the pendant"),
        ("violation", "eye: the controller reports a violation. Release it"),
        ("fault", "eye: the controller reports a fault. Release it"),
        ("recovery", "eye: recovery mode. Release it"),
        ("freeze on", r"eye: its stamps do not advance from 10\d\d\.\d+ s"),
        pytest.param(
            "slow 0.2",
            r"eye: only [4-7][.0-9]* states in a second came for \d\.\d s, at least 10 are needed",
            marks=pytest.mark.slow,
        ),
    ],
)
def test_faults_are_one_line_with_advice(there, fault, error):
    """A protective stop, constant stamps and a slow network end in one line with advice."""
    process, place = there
    robot = open_robot(place(motion="watch", reconnect_s=0.5))
    robot.state()
    process.tell(fault)
    with pytest.raises(DriverError, match=error) as raised:
        take(robot, 30)
    assert "\n" not in str(raised.value)
    robot.close()


def test_safeguard_stop_counts_only_for_moved_arms(there):
    """For a hand-guided arm it is usual: releasing the enabling device causes it."""
    process, place = there
    watched, moved = open_robot(place(motion="watch")), open_robot(place())
    process.tell("safeguard_stop")
    time.sleep(0.1)
    take(watched, 3)
    with pytest.raises(DriverError, match="eye: safeguard stop"):
        take(moved, 3)
    for robot in (watched, moved):
        robot.close()


def test_lost_connection_is_re_established(there):
    """After a hang-up it reconnects, and states continue."""
    process, place = there
    robot = open_robot(place(motion="watch"))
    before = robot.state().stamp_s
    process.tell("hang_up")
    assert robot.state().stamp_s > before
    after = [robot.state().stamp_s for _ in range(5)]
    assert np.all(np.diff(after) > 0)
    robot.close()


def test_vanished_controller_is_reported():
    """After the reconnection time one line says that the port is closed."""
    with controller() as (process, place):
        robot = open_robot(place(motion="watch", reconnect_s=0.3))
        robot.state()
        process.process.kill()
        process.process.wait()
        with pytest.raises(DriverError, match=r"nothing listens at .*:30004: .*; tried again for 0\.3 s"):
            take(robot, 1000)
        robot.close()


@pytest.mark.parametrize(
    ("words", "message"),
    [(b"HTTP/1.1 400\r\n", "does not speak RTDE 2"), (b"", r"does not answer\. Wait until the controller has started")],
)
def test_other_program_at_the_port_is_reported(words, message):
    """A peer that answers differently, or hangs up, is distinguished from a controller."""
    host = own_host()

    def answer(server):
        with server.accept()[0] as line:
            line.sendall(words)

    with socket.create_server((host, 30004)) as server:
        threading.Thread(target=answer, args=(server,), daemon=True).start()
        with pytest.raises(DriverError, match=message):
            open_robot(Place("eye", CELL, Path("."), {"host": host}))


@pytest.mark.parametrize(
    ("bits", "is_running"), [(0b0000, False), (0b0001, False), (0b0010, True), (0b1101, False), (0b1111, True)]
)
def test_running_program_has_its_own_bit(bits, is_running):
    """Power, buttons and others are other bits."""
    receiver = Receiver.__new__(Receiver)
    receiver._interface = SimpleNamespace(getRobotStatus=lambda: bits, isConnected=lambda: bits > 0)
    assert receiver.is_program_running == is_running
    assert receiver.is_connected == (bits > 0)


@pytest.mark.parametrize(("bits", "tolerated", "words"), [
    (0b01, (), None), (0b11, (), None), (1 << 2, (), "protective stop"), (1 << 3, (), "recovery mode"),
    (1 << 10 | 1 << 4, (), "safeguard stop"), (1 << 10 | 1 << 4, (4, 10), None), (1 << 10, (), "stopped for safety"),
    (1 << 9 | 1 << 2, (), "the controller reports a fault"), (1 << 4 | 1 << 6, (4, 10), "emergency stop of the robot"),
])  # fmt: skip
def test_most_specific_stop_is_reported(bits, tolerated, words):
    """Normal and reduced mode are no stops; a safeguard stop may be tolerated."""
    receiver = Receiver.__new__(Receiver)
    receiver._name, receiver._tolerated = "eye", tolerated
    receiver._interface = SimpleNamespace(getSafetyStatusBits=lambda: bits)
    if words is None:
        receiver._check_safety()
    else:
        with pytest.raises(DriverError, match=rf"^eye: {words}\. Release it at the pendant\.$"):
            receiver._check_safety()


@pytest.mark.parametrize("gives_joints", [True, False])
def test_state_is_read_completely_and_once(gives_joints):
    """States read before, or mixed with the next one, are skipped; with joints or the pose of the tool."""
    stamps = iter([7.0, 7.0, 7.0, 8.0, 8.25, 8.5, 8.5])
    receiver = Receiver.__new__(Receiver)
    receiver._last_s, receiver._gives_joints, receiver._tolerated = -1.0, gives_joints, ()
    receiver._interface = SimpleNamespace(
        getTimestamp=lambda: next(stamps),
        getActualQ=lambda: [0.1, 0.2, 0.3, 0.4, 0.5, 0.6],
        getActualTCPPose=lambda: [1.0, 2.0, 3.0, 0.0, 0.0, 0.5],
        getSafetyStatusBits=lambda: 1,
    )
    first = receiver._read_newer()
    assert first.stamp_s == 7.0
    if gives_joints:
        assert first.state.joints_rad.tolist() == [0.1, 0.2, 0.3, 0.4, 0.5, 0.6]
    else:
        pose = first.state.base_from_flange
        assert (pose.translation.tolist(), pose.rotvec[2]) == ([1.0, 2.0, 3.0], pytest.approx(0.5))
    assert receiver._read_newer() is None
    assert receiver._read_newer() is None
    assert receiver._read_newer().stamp_s == 8.5
