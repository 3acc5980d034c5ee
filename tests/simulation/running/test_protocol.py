"""Tests of a running cell in a second process, addressed by its folder."""

from __future__ import annotations

import json
import os
import signal
import socket
import stat
import subprocess
import sys
import time

import pytest

from basecal.errors import DriverError, InputError
from basecal.simulation.running import protocol
from basecal.simulation.running.protocol import Address, Connection, connect, decode, encode, read_address


@pytest.fixture(scope="module")
def process(tmp_path_factory):
    """Cell with an LED in its own process, its folder, and its first line."""
    folder = tmp_path_factory.mktemp("cell") / "running"
    words = [
        sys.executable,
        "-m",
        "basecal",
        "simulate",
        str(folder),
        "--process",
        "--speed",
        "0",
        "--target",
        "led",
        "--json",
    ]
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as process:
        yield process, folder, json.loads(process.stdout.readline())
        process.kill()


def test_process_prints_its_address(process):
    """The first line of the process has the port and the file with the token, which only its owner can read."""
    started, folder, first_line = process
    address = read_address(folder)
    assert (first_line["port"], first_line["host"]) == (address.port, "127.0.0.1")
    assert address.pid == started.pid
    assert stat.S_IMODE(os.stat(first_line["address"]).st_mode) == 0o600
    assert (folder / "truth.yaml").exists()


@pytest.mark.journey
def test_process_answers_requests(process):
    """States, images and the LED are served over one connection."""
    line = connect(read_address(process[1]))
    first, second = (line.ask(do="state", robot="eye") for _ in range(2))
    assert second["stamp_s"] > first["stamp_s"]
    assert line.ask(do="image", camera="wrist")["png_base64"].startswith("iVBORw0KGgo")
    assert line.ask(do="light", on=False) == {}
    line.close()


def test_process_ends_with_ctrl_c(process):
    """The process removes its address, and later clients are told to start it."""
    started, folder, _ = process
    line = connect(read_address(folder))
    line.ask(do="state", robot="eye")
    address = read_address(folder)
    started.send_signal(signal.SIGINT)
    assert started.wait(20) == 130
    with pytest.raises(DriverError, match="does not answer any more"):
        line.ask(do="state", robot="eye")
    line.close()
    with pytest.raises(DriverError, match=r"start it with `basecal simulate .* --process`"):
        read_address(folder)
    with pytest.raises(DriverError, match="no simulated cell listens on port"):
        connect(address)


def test_messages_are_single_lines():
    """A message is a line of one JSON object; an incomplete line is refused."""
    assert decode(encode({"do": "state"})) == {"do": "state"}
    for line in (b'{"do": "state"}', b"", b"[]\n", b"{\n", b"[" * 100_000 + b"\n"):
        with pytest.raises(InputError):
            decode(line)


def test_invalid_address_file_is_refused(tmp_path):
    """A file with other contents is no address."""
    (tmp_path / "derived").mkdir()
    (tmp_path / "derived" / "simulated.json").write_text('{"port": "x"}')
    with pytest.raises(DriverError):
        read_address(tmp_path)
    assert Address(port=1, token="t", pid=2).port == 1


def test_address_file_is_private_and_removed(tmp_path, monkeypatch):
    """The address is allowed while the cell runs. Removing it twice is no error."""
    allowed = []
    monkeypatch.setattr(protocol, "allow", lambda folder, words: allowed.extend(words))
    monkeypatch.setattr(protocol, "withdraw", lambda folder, word: allowed.clear())
    running = Address(port=4711, token="secret", pid=1)
    path = protocol.write_address(tmp_path, running)
    assert path == tmp_path / "derived" / "simulated.json"
    assert json.loads(path.read_text()) == {"port": 4711, "token": "secret", "pid": 1}
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    assert allowed == ["a simulated cell at 127.0.0.1:4711"]
    for _ in range(2):
        protocol.remove_address(tmp_path, running)
    assert not path.exists()
    assert allowed == []


def test_unresponsive_cell_times_out():
    """The exchange ends at its deadline, whatever part of a line has arrived."""
    ours, theirs = socket.socketpair()
    with ours, theirs:
        theirs.sendall(b"{")
        began = time.monotonic()
        with pytest.raises(TimeoutError):
            Connection("token", ours)._exchange_lines(b"?", began + 0.2)
