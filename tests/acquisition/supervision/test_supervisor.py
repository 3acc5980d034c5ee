"""The supervisor, spoken to as a capture does."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from contextlib import contextmanager

import pytest

from basecal.acquisition.supervision.frames import Channel, Kind
from basecal.acquisition.supervision.limits import CLOSE_S, STOP_S

pytestmark = pytest.mark.timed

MODULE = "basecal.acquisition.supervision.supervisor"


@contextmanager
def supervisor(*names):
    """A supervisor of arms that nothing was opened for, and the pipe into which the system writes signals."""
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
    """What it reports, and after which time."""
    began_s = time.monotonic()
    while time.monotonic() < began_s + most_s:
        for frame in channel.receive():
            if frame.kind == Kind.EVENT:
                return json.loads(frame.payload), time.monotonic() - began_s
        time.sleep(0.01)
    raise AssertionError("no event")


def test_the_first_reason_counts_and_is_reported_in_time():
    """Told to stop twice, it reports the first reason once its arms confirmed, or their time is over; then it ends."""
    with supervisor("left", "right") as (process, channel, _):
        channel.send(Kind.STOP, b"first")
        channel.send(Kind.STOP, b"second")
        said, after_s = event(channel)
        assert (said["reason"], said["by_signal"]) == ("first", False)
        assert set(said["unconfirmed"]) <= {"left", "right"}
        assert after_s < 3 * STOP_S + 1
        channel.send(Kind.CLOSE)
        process.wait(CLOSE_S + 2)


def test_signals_reach_it_without_the_capture():
    """A number in the pipe is enough; a second one kills a capture that does not end."""
    with supervisor("left") as (_, channel, write_fd):
        os.write(write_fd, bytes([signal.SIGTERM]))
        said, _ = event(channel)
    assert (said["reason"], said["by_signal"]) == ("SIGTERM", True)


def test_it_ends_with_the_capture():
    """Once nothing can be read from the capture any more, it stops the arms and is gone."""
    with supervisor("left") as (process, _, _):
        process.stdin.close()
        process.stdout.close()
        process.wait(CLOSE_S + 4)
