"""Whether something listens, and in a line why not."""

from __future__ import annotations

import socket

import pytest

from basecal.acquisition.links.reach import connect
from basecal.errors import DriverError
from shared.second_process import own_host


def test_what_listens_is_reached():
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
        (PermissionError, "eye: this computer may not connect to there:7"),
        (TimeoutError, "eye: there:7 is not reachable: is it on, and in the same network?"),
        (OSError, "eye: there:7 is not reachable"),
    ],
)
def test_why_not_is_a_line(monkeypatch, error, words):
    """Each way in which a network says no has its words, and what to do."""

    def no(*_, **__):
        raise error

    monkeypatch.setattr(socket, "create_connection", no)
    with pytest.raises(DriverError) as raised:
        connect("eye", "there", 7, "a clock")
    assert str(raised.value).startswith(words)
    assert "\n" not in str(raised.value)


def test_a_port_at_which_nothing_listens():
    """As the system itself says it."""
    with pytest.raises(DriverError, match="nothing listens"):
        connect("eye", own_host(), 9, "a clock")
