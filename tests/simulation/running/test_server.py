"""Tests of the answers of a running cell's server."""

from __future__ import annotations

import json
import socket
import threading
from types import SimpleNamespace

import numpy as np
import pytest

from basecal.errors import DriverError
from basecal.simulation.running import server as server_module
from basecal.simulation.running.plant import Clock, Plant
from basecal.simulation.running.protocol import Address, connect, encode
from basecal.simulation.running.server import CellServer
from shared.facing_arms import facing_arms

TOKEN = "open-sesame"


@pytest.fixture(scope="module")
def server():
    with CellServer(Plant(facing_arms("led"), Clock(0)), TOKEN) as server:
        thread = threading.Thread(target=server.serve_forever, daemon=True)
        thread.start()
        yield server
        server.shutdown()
        thread.join()


def address(server, token=TOKEN):
    return Address(port=server.port, token=token, pid=0)


def test_server_listens_on_loopback_only(server):
    """The address of the server is loopback."""
    assert server.server_address[0] == "127.0.0.1"


def test_states_follow_move_and_stop(server):
    """The states of an arm show its move, and its stop on request."""
    line = connect(address(server))
    joints = np.array(line.ask(do="state", robot="hand")["joints_rad"])
    line.ask(do="move", robot="hand", joints_rad=(joints + 0.3).tolist(), speed_rad_s=0.5)
    for _ in range(20):
        line.ask(do="state", robot="hand")
    line.ask(do="stop", robot="hand")
    for _ in range(40):
        rest = line.ask(do="state", robot="hand")["joints_rad"]
    assert rest == line.ask(do="state", robot="hand")["joints_rad"]
    assert 0 < rest[0] - joints[0] < 0.3
    line.close()


@pytest.mark.parametrize(
    ("request_line", "message"),
    [
        ({"do": "state", "robot": "eye"}, "token"),
        ({"token": "wrong", "do": "state", "robot": "eye"}, "token"),
        ({"token": 7, "do": "state"}, "token"),
        ({"token": "\ud800", "do": "state"}, "token"),
        ({"token": TOKEN, "do": "dance"}, "no request 'dance'; there are: state, move"),
        ({"token": TOKEN, "do": "state", "robot": "foot"}, "no robot 'foot'"),
        ({"token": TOKEN, "do": "move", "robot": "eye", "joints_rad": [1, 2]}, "6 joints"),
        ({"token": TOKEN, "do": "move", "robot": "eye", "joints_rad": "all"}, "joints_rad"),
        ({"token": TOKEN, "do": "state", "robt": "eye"}, "unknown field"),
        ([1], "one JSON object"),
        ("not JSON", "one JSON object"),
    ],
)
def test_invalid_requests_are_refused(server, request_line, message):
    """Anything but a request with the right token gets a line with the reason, and the connection stays open."""
    with socket.create_connection(("127.0.0.1", server.port), timeout=10) as line, line.makefile("rb") as answers:
        line.sendall((request_line if request_line == "not JSON" else json.dumps(request_line)).encode() + b"\n")
        answer = json.loads(answers.readline())
        assert (answer["ok"], message in answer["error"]) == (False, True), answer
        line.sendall(json.dumps({"token": TOKEN, "do": "light", "on": True}).encode() + b"\n")
        assert json.loads(answers.readline()) == {"ok": True}


def test_endless_line_is_refused(server):
    """A line without a newline that exceeds a request is refused, and the connection is closed."""
    with socket.create_connection(("127.0.0.1", server.port), timeout=10) as line, line.makefile("rb") as answers:
        line.sendall(b"x" * 2**16)
        assert json.loads(answers.readline())["ok"] is False


def test_wrong_token_of_driver_is_reported(server):
    """A driver with a wrong token gets an error that states it."""
    line = connect(address(server, "guess"))
    with pytest.raises(DriverError, match="token is missing or wrong"):
        line.ask(do="state", robot="eye")
    line.close()


@pytest.mark.parametrize(
    ("silent_s", "is_real_time", "is_busy", "stopped"),
    [
        (0.2, True, False, []),
        (0.4, True, False, ["eye", "hand"]),
        (0.4, False, False, []),
        (0.4, True, True, []),
    ],
)
def test_arms_stop_without_requests(monkeypatch, silent_s, is_real_time, is_busy, stopped):
    """Arms stop in real time if no request arrives, unless one is being answered."""
    now, arms = [100.0], []
    monkeypatch.setattr(server_module.time, "monotonic", lambda: now[0])
    plant = SimpleNamespace(is_real_time=is_real_time, robots=("eye", "hand"), stop=arms.append)
    with CellServer(plant, TOKEN) as quiet:
        now[0] += silent_s
        if is_busy:
            quiet.refuse_requests()
        quiet.service_actions()
        assert quiet.daemon_threads
    assert arms == stopped


def test_valid_requests_reset_the_watchdog(monkeypatch):
    """A refused request does not reset the watchdog."""
    now, arms = [100.0], []
    monkeypatch.setattr(server_module.time, "monotonic", lambda: now[0])
    plant = SimpleNamespace(is_real_time=True, robots=("eye",), stop=arms.append)
    with CellServer(plant, TOKEN) as quiet:
        for token, stops in ((TOKEN, 0), ("wrong", 1)):
            now[0] += 0.2
            quiet.answer(encode({"token": token, "do": "stop", "robot": "eye"}))
            arms.clear()
            now[0] += 0.2
            quiet.service_actions()
            assert len(arms) == stops
