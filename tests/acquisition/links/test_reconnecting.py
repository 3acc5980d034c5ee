"""Tests of the base class of drivers that reconnect."""

from __future__ import annotations

import socket
import time

import numpy as np
import pytest

from basecal.acquisition.driver import Reading, Robot
from basecal.acquisition.links.reconnecting import LostLink, ReconnectingRobot, connect
from basecal.cell import RobotState
from basecal.errors import DriverError
from shared.second_process import own_host

pytestmark = pytest.mark.timed


class Arm(ReconnectingRobot):
    """Arm whose connection yields given results: a stamp, or an error to raise."""

    def __init__(self, coming, reconnect_s=0.3, refusals=(), **more):
        self.coming, self.refusals, self.connections = list(coming), list(refusals), 0
        super().__init__("eye", reconnect_s, rate_hz=500.0, **more)

    def connect(self):
        self.connections += 1
        if self.connections > 1 and self.refusals:
            raise self.refusals.pop(0)

    def read(self):
        given = self.coming.pop(0) if len(self.coming) > 1 else self.coming[0]
        if isinstance(given, Exception):
            raise given
        return None if given is None else Reading(given, RobotState(joints_rad=np.array([given])))


class Repeating(Arm):
    repeats_stamps = True


def test_each_state_is_newer():
    """Pending, repeated and reordered states are skipped."""
    arm = Arm([None, 1.0, 1.0, 0.5, 2.0, 3.0])
    assert isinstance(arm, Robot)
    assert [arm.state().stamp_s for _ in range(3)] == [1.0, 2.0, 3.0]
    assert arm.connections == 1


@pytest.mark.parametrize(
    "error", [LostLink("gone"), ConnectionResetError("gone"), RuntimeError("of a library"), EOFError()]
)
def test_lost_connection_is_re_established(error):
    """After any error of a library, states continue over a new connection, even if the first attempt fails."""
    arm = Arm([1.0, error, 2.0], reconnect_s=5.0, refusals=[ConnectionRefusedError(), DriverError("it starts")])
    assert [arm.state().stamp_s, arm.state().stamp_s] == [1.0, 2.0]
    assert arm.connections == 4
    assert arm.is_connected


def test_permanently_lost_connection_is_reported():
    """After `reconnect_s` the error has robot, cause and time."""
    arm = Arm([1.0, ConnectionResetError("by peer")], reconnect_s=0.0)
    arm.state()
    arm.refusals = 99 * [ConnectionRefusedError("no port")]
    with pytest.raises(DriverError, match=r"^eye: its connection was lost \(ConnectionRefusedError no port\); tried"):
        arm.state()
    assert not arm.is_connected


def test_final_error_is_not_retried():
    """A protective stop ends the capture at once."""
    arm = Arm([1.0, DriverError("eye: protective stop")], reconnect_s=60.0)
    arm.state()
    began_s = time.monotonic()
    with pytest.raises(DriverError, match="eye: protective stop"):
        arm.state()
    assert time.monotonic() - began_s < 5


def test_failed_first_connection_is_an_error():
    """A wrong address is an error at once."""

    class Absent(Arm):
        def connect(self):
            raise ConnectionRefusedError("no port")

    with pytest.raises(DriverError, match=r"eye: no connection \(ConnectionRefusedError no port\)\. Is it on, and"):
        Absent([1.0], reconnect_s=60.0)


@pytest.mark.parametrize("stamp_s", [2.0, 1.0])
def test_constant_stamps_end_in_time(stamp_s):
    """If stamps are constant or go back, the error has the last stamp."""
    arm = Arm([2.0, stamp_s], reconnect_s=0.0)
    arm.state()
    with pytest.raises(DriverError, match=r"eye: stale stamps: \d+ states came, none with a stamp newer than 2\.000 s"):
        arm.state()


def test_stamps_of_changes_may_repeat():
    """A server that stamps changes may repeat the stamp of an unchanged state."""
    arm = Repeating([2.0])
    assert [arm.state().stamp_s for _ in range(3)] == [2.0, 2.0, 2.0]


def test_implausible_states_are_refused():
    """A NaN ends the capture, and no reconnection hides it."""
    arm = Arm([float("nan")], reconnect_s=60.0)
    with pytest.raises(DriverError, match="eye: implausible state"):
        arm.state()


def test_listening_port_is_reached():
    """The connection is one to the port."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
        with connect("eye", "127.0.0.1", port, "anything") as line:
            assert line.getpeername() == ("127.0.0.1", port)


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (ConnectionRefusedError, "eye: nothing listens at there:7: is a clock running there, and is the port right?"),
        (socket.gaierror, "eye: there is no host 'there': look at its address in cell.yaml"),
        (PermissionError, "eye: this computer is not allowed to connect to there:7"),
        (TimeoutError, "eye: there:7 is not reachable: is it on, and in the same network?"),
        (OSError, "eye: there:7 is not reachable"),
    ],
)
def test_network_errors_have_one_line_with_advice(monkeypatch, error, words):
    """Each refusal of a network has its message and advice."""

    def no(*_, **__):
        raise error

    monkeypatch.setattr(socket, "create_connection", no)
    with pytest.raises(DriverError) as raised:
        connect("eye", "there", 7, "a clock")
    assert str(raised.value).startswith(words)
    assert "\n" not in str(raised.value)


def test_closed_port_is_reported():
    """The message is that of the system."""
    with pytest.raises(DriverError, match="nothing listens"):
        connect("eye", own_host(), 9, "a clock")
