"""Tests of ur-rtde's program on a controller in a separate process."""

from __future__ import annotations

import socket
import threading
import time
from types import SimpleNamespace

import pytest

from basecal.acquisition.ur import program as ur_program
from basecal.acquisition.ur.options import UrOptions
from basecal.acquisition.ur.program import Program
from basecal.errors import DriverError

pytest.importorskip("rtde_control")

pytestmark = pytest.mark.timed


def program(place):
    """Program of a controller."""
    return Program("eye", UrOptions(**place().options))


def test_program_is_sent_on_first_use_and_stopped_at_the_end(there):
    """Before the first request the controller has none of it; on closing it is stopped."""
    process, place = there
    asked = program(place)
    assert not asked.was_sent
    assert process.tell("tell").split()[2:] == []
    assert asked.ask(lambda line: line.isJointsWithinSafetyLimits([0.0] * 6))
    assert asked.was_sent
    asked.close()
    assert process.tell("tell").split()[2:] == ["35", "37", "255"]


def test_program_is_not_sent_again(there):
    """Stopped by a person at the pendant, it refuses all requests, and no program is sent."""
    process, place = there
    asked = program(place)
    assert asked.ask(lambda line: line.isJointsWithinSafetyLimits([0.0] * 6))
    process.tell("stop_program")
    time.sleep(0.1)
    with pytest.raises(DriverError, match="eye: the program on the controller was stopped"):
        asked.ask(lambda line: line.isProgramRunning())
    assert process.tell("log").count(":script:") == 1


class Gone:
    """Connection of ur-rtde to a controller that hung up."""

    def isConnected(self):
        return False

    def kickWatchdog(self):
        raise AssertionError("it would connect again, and send its program")

    stopJ = stopScript = kickWatchdog
    disconnect = print


def test_lost_link_is_a_closed_connection():
    """The library is not used afterwards, even if it reconnects; a stop goes to the dashboard."""
    asked = Program("eye", UrOptions(host="127.0.0.1"))
    asked._interface = Gone()
    for _ in range(2):
        with pytest.raises(DriverError, match=r"^eye: its connection was closed \(End of file\)$"):
            asked.keep_alive()
        asked._interface.isConnected = lambda: True
    with pytest.raises(DriverError, match="eye: its dashboard did not take the stop"):
        asked.stop()
    asked.close()


def test_watchdog_stops_the_arm_of_a_silent_computer(there):
    """With heartbeats the arm continues; without, it is at rest within half a second, far from its goal."""
    process, place = there
    asked = program(place)
    asked.ask(lambda line: line.moveJ([3.0, -1.5, 1.5, 0.0, 0.5, 0.0], 0.5, 1.0, True))
    until = time.monotonic() + 0.8
    while time.monotonic() < until:
        asked.keep_alive()
        time.sleep(0.02)
    assert ":watchdog:" not in process.tell("log")
    silent_s = time.monotonic()
    time.sleep(0.6)
    at_s, why, was_moving = process.tell("log").split()[-1].split(":")
    assert (why, was_moving) == ("watchdog", "moving")
    assert float(at_s) - silent_s < 0.5
    with pytest.raises(DriverError, match="stopped"):
        asked.ask(lambda line: line.isProgramRunning())


@pytest.mark.parametrize(("reply", "refusal"), [(b"Stopped\n", None), (b"Failed to execute: stop\n", "Failed")])
def test_dashboard_refusal_is_no_confirmed_stop(monkeypatch, reply, refusal):
    """While another call holds the connection, a stop goes to the dashboard.

    Its reply shows whether the stop was accepted.
    """
    with socket.create_server(("127.0.0.1", 0)) as server:
        monkeypatch.setattr(ur_program, "_DASHBOARD_PORT", server.getsockname()[1])

        def serve():
            connection, _ = server.accept()
            with connection:
                connection.sendall(b"Connected: Universal Robots Dashboard Server\n")
                assert connection.recv(64) == b"stop\n"
                connection.sendall(reply)

        threading.Thread(target=serve, daemon=True).start()
        asked = Program("eye", UrOptions(host="127.0.0.1"))
        asked._interface = SimpleNamespace(isConnected=lambda: True)
        with asked._lock:
            if refusal is None:
                asked.stop()
            else:
                with pytest.raises(DriverError, match=rf"^eye: its dashboard did not take the stop \({refusal}"):
                    asked.stop()


def test_controller_in_local_mode_is_reported(there):
    """It accepts no program: the message says what to choose on the pendant."""
    process, place = there
    process.tell("local")
    with pytest.raises(DriverError, match="eye: no permission to move: choose remote control"):
        program(place).ask(lambda line: line.isProgramRunning())


def test_watchdog_without_a_link_is_an_error(monkeypatch):
    """The client's error may have any name: after a hang-up it may be `ok`."""

    class Line:
        def isConnected(self):
            return True

        def kickWatchdog(self):
            raise RuntimeError("ok")

    asked = Program("eye", UrOptions(host="here"))
    monkeypatch.setattr(asked, "_interface", Line())
    for _ in range(2):
        with pytest.raises(DriverError, match=r"^eye: its connection was closed \(ok\)$"):
            asked.keep_alive()
