"""Tests of sessions with an OPC UA server in a separate process."""

from __future__ import annotations

import socket
import struct
import subprocess
import sys
import textwrap
import threading
import time
from contextlib import ExitStack, suppress
from dataclasses import replace

import pytest
from pydantic import ValidationError

from basecal.acquisition.opcua.nodes import axis_position_nodes
from basecal.acquisition.opcua.options import OpcuaOptions
from basecal.acquisition.opcua.session import Session
from basecal.errors import DriverError
from shared.needed import needed

needed("asyncua", "opcua")


def session(port, allow_plaintext=True, **options):
    """Session that reads the axes."""
    said = OpcuaOptions(url=f"opc.tcp://127.0.0.1:{port}/robot", reconnect_s=1.0, **options)
    return Session("eye", said, lambda client: axis_position_nodes(client, "eye", None), allow_plaintext)


def test_missing_value_is_reported(opcua_robot):
    """A failed sensor is reported with its node and the server's status."""
    read = session(opcua_robot.port)
    opcua_robot.tell("bad")
    with pytest.raises(DriverError, match=r"eye: the server has no value of .*: BadSensorFailure"):
        read.read()
    opcua_robot.tell("reset")
    assert len(read.read().numbers) == 6
    read.close()


def test_values_without_stamps_follow_a_steady_clock(opcua_robot, monkeypatch):
    """A step of this computer's clock makes no value older than the last one; the stamp is near UTC."""
    read = session(opcua_robot.port)
    values = [
        replace(each, SourceTimestamp=None, ServerTimestamp=None) for each in read._client.read_attributes(read.nodes)
    ]
    monkeypatch.setattr(read._client, "read_attributes", lambda nodes: values)
    first = read.read()
    assert first.stamp_s == pytest.approx(time.time(), abs=5.0)
    monkeypatch.setattr(time, "time", lambda: first.stamp_s - 3600.0)
    assert first.stamp_s < read.read().stamp_s < first.stamp_s + 5.0
    read.close()


def test_missing_permission_is_one_line(opcua_robot, monkeypatch):
    """An unknown user is refused in one line; with the correct password values arrive."""
    with pytest.raises(DriverError, match="eye: no permission: the server refuses this user"):
        session(opcua_robot.port, user="cell", password_in="BASECAL_NO_SUCH")
    monkeypatch.setenv("BASECAL_CELL", "secret")
    read = session(opcua_robot.port, user="cell", password_in="BASECAL_CELL")
    assert len(read.read().numbers) == 6
    read.close()


def test_password_is_not_sent_in_plain_text(opcua_robot, monkeypatch):
    """A server without encryption gets no password, unless the user allowed it on the command line."""
    monkeypatch.setenv("BASECAL_OPCUA_PASSWORD", "secret")
    with pytest.raises(DriverError, match=r"only without encryption.*add --allow-plaintext"):
        session(opcua_robot.port, allow_plaintext=False, user="cell")
    read = session(opcua_robot.port, user="cell")
    assert len(read.read().numbers) == 6
    read.close()


@pytest.mark.parametrize("variable", ["AWS_SECRET_ACCESS_KEY", "HOME", "BASECAL_", "basecal_x"])
def test_secrets_of_other_programs_are_not_read(variable):
    """A cell can name only this program's variables."""
    with pytest.raises(ValidationError, match="password_in"):
        OpcuaOptions(url="opc.tcp://stranger", user="me", password_in=variable)


def test_other_program_at_the_port_is_reported():
    """A peer that hangs up is reported as a server that does not answer."""

    def hang_up(other):
        for _ in range(2):
            other.accept()[0].close()

    with socket.create_server(("127.0.0.1", 0)) as other:
        threading.Thread(target=hang_up, args=(other,), daemon=True).start()
        with pytest.raises(DriverError, match=r"eye: the server (does not answer|says)"):
            session(other.getsockname()[1])


HOSTILE = {
    "zeros": bytes(4000),
    "huge": b"ACKF\xff\xff\xff\x7f" + bytes(1000),
    "error": b"ERRF" + struct.pack("<I8s", 16, b"\xff" * 8),
    "channel": b"ACKF" + struct.pack("<6I", 28, 0, *[2**16] * 4) + b"OPNF" + struct.pack("<I52s", 60, b"\xff" * 52),
}
ASKING = """
    import sys
    from basecal.acquisition.opcua.options import OpcuaOptions
    from basecal.acquisition.opcua.session import Session
    from basecal.errors import DriverError
    for port in sys.argv[1:]:
        options = OpcuaOptions(url=f"opc.tcp://127.0.0.1:{port}", joints=["ns=2;s=j"], unit="rad")
        try:
            Session("eye", options, lambda client: [client.get_node("ns=2;s=j")])
        except DriverError as error:
            print(error)
"""


def serve(server, answer):
    """Answer two connections with the same bytes."""
    for _ in range(2):
        with server.accept()[0] as connection, suppress(OSError):
            connection.recv(4096)
            connection.sendall(answer)


@pytest.fixture(scope="module")
def asked():
    """Process that contacted each hostile server."""
    with ExitStack() as stack:
        servers = [stack.enter_context(socket.create_server(("127.0.0.1", 0))) for _ in HOSTILE]
        for server, answer in zip(servers, HOSTILE.values(), strict=True):
            threading.Thread(target=serve, args=(server, answer), daemon=True).start()
        ports = [str(server.getsockname()[1]) for server in servers]
        command = [sys.executable, "-c", textwrap.dedent(ASKING), *ports]
        yield subprocess.run(command, capture_output=True, text=True, timeout=60, check=True)


@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_server_causes_one_line(asked, name):
    """Whatever it answers, no traceback of the library reaches the terminal."""
    lines = dict(zip(HOSTILE, asked.stdout.splitlines(), strict=True))
    assert lines[name].startswith("eye: the server")
    assert asked.stderr == ""
