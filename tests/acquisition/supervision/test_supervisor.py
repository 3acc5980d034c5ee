"""Tests of the supervisor with the messages of a capture."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from contextlib import contextmanager
from types import SimpleNamespace

import pytest

from basecal.acquisition.supervision.frames import Channel, Frame, Kind
from basecal.acquisition.supervision.limits import CLOSE_S, STOP_S
from basecal.acquisition.supervision.supervisor import Supervisor

pytestmark = pytest.mark.timed

MODULE = "basecal.acquisition.supervision.supervisor"


@contextmanager
def supervisor(*names):
    """Supervisor of unopened arms, and the pipe of signal numbers."""
    signals_fd, write_fd = os.pipe()
    command = [sys.executable, "-m", MODULE, str(signals_fd), *names]
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, pass_fds=(signals_fd,), start_new_session=True
    ) as process:
        channel = Channel(process.stdout.fileno(), process.stdin.fileno())
        try:
            yield process, channel, write_fd
        finally:
            process.kill()
            os.close(signals_fd)
            os.close(write_fd)


def event(channel, most_s=5.0):
    """Report of the supervisor, and its time."""
    began_s = time.monotonic()
    while time.monotonic() < began_s + most_s:
        for frame in channel.receive():
            if frame.kind == Kind.EVENT:
                return json.loads(frame.payload), time.monotonic() - began_s
        time.sleep(0.01)
    raise AssertionError("no event")


def test_first_reason_is_reported_in_time():
    """After two stops, the first reason is reported once arms confirmed or the timeout is over.

    Then the process ends.
    """
    with supervisor("left", "right") as (process, channel, _):
        channel.send(Kind.STOP, b"first")
        channel.send(Kind.STOP, b"second")
        said, after_s = event(channel)
        assert (said["reason"], said["by_signal"]) == ("first", False)
        assert set(said["unconfirmed"]) <= {"left", "right"}
        assert after_s < 3 * STOP_S + 1
        channel.send(Kind.CLOSE)
        process.wait(CLOSE_S + 2)


def test_signals_work_without_the_capture():
    """A number in the pipe suffices; a second one kills a capture that does not end."""
    with supervisor("left") as (_, channel, write_fd):
        os.write(write_fd, bytes([signal.SIGTERM]))
        said, _ = event(channel)
    assert (said["reason"], said["by_signal"]) == ("SIGTERM", True)


def test_states_do_not_fill_the_link_to_a_capture_that_does_not_read():
    """Those for which the pipe has no room are left out, so that the capture receives the next report."""
    read_fd, write_fd = os.pipe()
    idle_fd, hold_fd = os.pipe()
    capture, supervised = Channel(read_fd, hold_fd), Supervisor.__new__(Supervisor)
    supervised._parent = Channel(idle_fd, write_fd)
    state = Frame(Kind.READING, 0, bytes(2**14))
    for _ in range(1000):
        supervised._handle_report(SimpleNamespace(heard_s=0.0, number=0), state)
    supervised._parent.send(Kind.EVENT, b"{}")
    frames = []
    while supervised._parent.has_unsent or not frames:
        frames += capture.receive()
        supervised._parent.flush()
    frames += capture.receive()
    assert frames[0] == state
    assert frames[-1].kind == Kind.EVENT
    assert len(frames) < 20
    for channel in (capture, supervised._parent):
        channel.close()


def test_supervisor_ends_with_the_capture():
    """Once the capture's pipe is closed, it stops the arms and exits."""
    with supervisor("left") as (process, _, _):
        process.stdin.close()
        process.stdout.close()
        process.wait(CLOSE_S + 4)
