"""Sessions with an OPC UA server in a process of its own."""

from __future__ import annotations

import socket
import threading

import pytest

from basecal.acquisition.opcua.nodes import axes_of_devices
from basecal.acquisition.opcua.options import OpcuaOptions
from basecal.acquisition.opcua.session import Session
from basecal.errors import DriverError
from shared.needed import needed

needed("asyncua", "opcua")


def session(port, **options):
    """One that reads the axes."""
    said = OpcuaOptions(url=f"opc.tcp://127.0.0.1:{port}/robot", reconnect_s=1.0, **options)
    return Session("eye", said, lambda client: axes_of_devices(client, "eye", None))


def test_values_that_a_server_has_none_of(opcua_robot):
    """A sensor that failed is told by its node and the server's word."""
    read = session(opcua_robot.port)
    opcua_robot.tell("bad")
    with pytest.raises(DriverError, match=r"eye: the server has no value of .*: BadSensorFailure"):
        read.read()
    opcua_robot.tell("reset")
    assert len(read.read().numbers) == 6
    read.close()


def test_no_permission(opcua_robot, monkeypatch):
    """A user whom the server does not know is refused in one line; with the right password values come."""
    with pytest.raises(DriverError, match="eye: no permission: the server refuses this user"):
        session(opcua_robot.port, user="cell", password_in="NO_SUCH_VARIABLE")
    monkeypatch.setenv("CELL_PASSWORD", "secret")
    read = session(opcua_robot.port, user="cell", password_in="CELL_PASSWORD")
    assert len(read.read().numbers) == 6
    read.close()


def test_another_program_at_the_port():
    """What hangs up at once is told as a server that does not answer."""

    def hang_up(other):
        for _ in range(2):
            other.accept()[0].close()

    with socket.create_server(("127.0.0.1", 0)) as other:
        threading.Thread(target=hang_up, args=(other,), daemon=True).start()
        with pytest.raises(DriverError, match=r"eye: the server (does not answer|says)"):
            session(other.getsockname()[1])
