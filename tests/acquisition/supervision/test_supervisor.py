"""Tests of the supervisor with the messages of a capture."""

from __future__ import annotations

import json
import os
import pickle
import signal
import subprocess
import sys
import time
from contextlib import contextmanager
from types import SimpleNamespace

import pytest

from basecal.acquisition.supervision.frames import Channel, Frame, Kind
from basecal.acquisition.supervision.limits import (
    CLOSE_S,
    FORCED_END_S,
    HANG_LIMIT_S,
    HEARTBEAT_S,
    PARENT_HANG_LIMIT_S,
    REST_HANG_LIMIT_S,
    STALE_S,
    STOP_S,
)
from basecal.acquisition.supervision.standstill import Standstill
from basecal.acquisition.supervision.supervisor import Supervisor, _Arm

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


@pytest.mark.timed
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


@pytest.mark.timed
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


@pytest.mark.timed
def test_supervisor_ends_with_the_capture():
    """Once the capture's pipe is closed, it stops the arms and exits."""
    with supervisor("left") as (process, _, _):
        process.stdin.close()
        process.stdout.close()
        process.wait(CLOSE_S + 4)


class Link:
    """Channel that keeps what is sent, and receives what it is given; after that, the other process has ended."""

    has_unsent, read_fd = False, 0

    def __init__(self):
        self.sent, self.frames = [], None

    def send(self, kind, payload=b"", arm=0):
        """Keep a frame."""
        self.sent.append(Frame(kind, arm, payload))

    def flush(self):
        """Everything is sent at once."""

    def receive(self):
        """The next frames."""
        if self.frames is None:
            raise EOFError
        frames, self.frames = self.frames, None
        return frames

    def kinds(self):
        """Kinds of the frames sent since the last call."""
        kinds, self.sent = [frame.kind for frame in self.sent], []
        return kinds


class Process:
    """Process of an arm that ends with a code."""

    def __init__(self, code=0):
        self.code, self.is_killed = code, False

    def wait(self):
        """Its exit code."""
        return self.code

    def kill(self):
        """Note that it was killed."""
        self.is_killed = True


def arms(count=2):
    """Open arms that were heard at zero seconds."""
    names = ("left", "right", "third")[:count]
    return [_Arm(number, name, Process(), Link(), 0.0, is_open=True) for number, name in enumerate(names)]


def made(*of, **fields):
    """Supervisor without processes, at zero seconds."""
    found = Supervisor.__new__(Supervisor)
    found._parent, found._arms, found._parent_pid, found._signals_fd = Link(), list(of), 4711, -1
    found._parent_heard_s = found._heartbeat_s = 0.0
    found._standstill, found._ready = Standstill(), SimpleNamespace(unregister=lambda fd: None)
    found._stopped_s = found._closed_s = found._forced_s = None
    found._reason, found._signals, found._is_reported, found._has_parent_ended = "", 0, False, False
    for name, value in fields.items():
        setattr(found, name, value)
    return found


def test_no_request_passes_after_a_stop():
    """Before it, requests reach the arm of their number alone; a stop reaches all arms, once."""
    left, right = arms()
    found = made(left, right)
    for kind in (Kind.OPEN, Kind.REQUEST):
        found._handle_command(Frame(kind, 1, b"move"))
    assert (left.channel.kinds(), right.channel.sent) == (
        [],
        [Frame(Kind.OPEN, 0, b"move"), Frame(Kind.REQUEST, 0, b"move")],
    )
    for reason in (b"a person came", b"later"):
        found._handle_command(Frame(Kind.STOP, 0, reason))
    found._handle_command(Frame(Kind.REQUEST, 0, b"move"))
    found._handle_command(Frame(Kind.REQUEST, 1, b"move"))
    assert (left.channel.kinds(), right.channel.kinds()) == ([Kind.STOP], [Kind.OPEN, Kind.REQUEST, Kind.STOP])
    assert found._reason == "a person came"
    for _ in range(2):
        found._handle_command(Frame(Kind.CLOSE, 0, b""))
    assert (left.channel.kinds(), right.channel.kinds()) == ([Kind.CLOSE], [Kind.CLOSE])


@pytest.mark.parametrize(("is_moving", "limit_s"), [(True, HANG_LIMIT_S), (False, REST_HANG_LIMIT_S)])
def test_silent_driver_stops_all_arms(is_moving, limit_s):
    """While any arm moves the limit is short. An arm that is not open yet, or that ended, may be silent."""
    for silence_s, state, reason in (
        (0.9 * limit_s, {}, ""),
        (1.1 * limit_s, {}, "right: its driver hangs"),
        (1.1 * limit_s, {"is_open": False}, ""),
        (1.1 * limit_s, {"is_gone": True}, ""),
    ):
        left, right = arms()
        left.is_moving, left.heard_s = is_moving, silence_s
        for name, value in state.items():
            setattr(right, name, value)
        found = made(left, right, _parent_heard_s=silence_s)
        found._check_timeouts(silence_s)
        assert found._reason == reason


@pytest.mark.parametrize(("is_moving", "age_s", "is_stopped"), [
    (True, 0.9 * STALE_S, False), (True, 1.1 * STALE_S, True), (False, 1.1 * STALE_S, False), (True, None, False),
])  # fmt: skip
def test_old_state_of_any_arm_ends_a_motion(is_moving, age_s, is_stopped):
    """Also of an arm at rest, beside which another moves; an arm that is only asked sends no states."""
    left, right = arms()
    left.is_moving, left.heard_s, right.heard_s = is_moving, 100.0, 100.0
    right.read_s = None if age_s is None else 100.0 - age_s
    found = made(left, right, _parent_heard_s=100.0)
    found._check_timeouts(100.0)
    assert found._reason == ("right: no state came for 0.45 s while an arm moved: its link is lost" * is_stopped)


@pytest.mark.parametrize(
    ("is_moving", "factor", "is_stopped"), [(True, 0.9, False), (True, 1.1, True), (False, 9, False)]
)
def test_silent_capture_ends_a_motion(is_moving, factor, is_stopped):
    """At rest it may compute for as long as it wants."""
    (left,) = arms(1)
    left.is_moving, left.heard_s = is_moving, 100.0
    found = made(left, _parent_heard_s=100.0 - factor * PARENT_HANG_LIMIT_S)
    found._check_timeouts(100.0)
    assert found._reason == ("the capture hangs while an arm moves" * is_stopped)


def test_heartbeats_go_to_all_processes():
    """To the capture and to each arm, in their period."""
    found = made(*arms())
    links = [found._parent, *(arm.channel for arm in found._arms)]
    found._check_timeouts(0.9 * HEARTBEAT_S)
    assert [link.kinds() for link in links] == [[], [], []]
    for _ in range(2):
        found._check_timeouts(1.1 * HEARTBEAT_S)
    assert [link.kinds() for link in links] == [[Kind.ALIVE]] * 3


def events(found):
    """Reports to the capture."""
    return [json.loads(frame.payload) for frame in found._parent.sent if frame.kind == Kind.EVENT]


def test_confirmed_stop_is_reported_at_once():
    """The report comes once; an arm whose process ended is not waited for, but did not confirm."""
    left, right, third = arms(3)
    found = made(left, right, third)
    found._report(5.0)
    assert events(found) == []
    found.stop("a person came")
    right.is_gone = True
    left.has_stopped = True
    found._report(found._stopped_s)
    assert events(found) == []
    third.has_stopped = True
    for _ in range(2):
        found._report(found._stopped_s)
    assert events(found) == [{"reason": "a person came", "unconfirmed": ["right"], "by_signal": False}]
    assert not any(arm.process.is_killed for arm in found._arms)


def test_unconfirmed_stop_ends_the_process_of_a_watched_arm():
    """After the timeout the controller's watchdog stops it; the process of any other arm may still do so."""
    left, right, third = arms(3)
    right.stops_if_killed, third.has_stopped = False, True
    found = made(left, right, third)
    found.stop("SIGTERM")
    found._report(found._stopped_s + 0.9 * STOP_S)
    assert events(found) == []
    found._report(found._stopped_s + 1.1 * STOP_S)
    assert events(found) == [{"reason": "SIGTERM", "unconfirmed": ["left", "right"], "by_signal": True}]
    assert [arm.process.is_killed for arm in found._arms] == [True, False, False]
    assert [arm.is_gone for arm in found._arms] == [True, False, False]


def test_second_signal_kills_a_capture_that_does_not_end(monkeypatch):
    """The first one stops the arms; other signals have no effect, nor has a capture that ended."""
    killed, numbers = [], iter([[signal.SIGUSR1], [signal.SIGINT], [signal.SIGTERM], [signal.SIGINT]])
    monkeypatch.setattr(os, "read", lambda fd, count: bytes(next(numbers)))
    monkeypatch.setattr(os, "kill", lambda pid, number: killed.append((pid, number)))
    found = made(*arms())
    reasons = []
    for _ in range(2):
        found._receive_signals()
        reasons.append((found._reason, found._forced_s))
    assert reasons == [("", None), ("Ctrl-C", None)]
    found._receive_signals()
    forced_s = found._forced_s
    found._receive_signals()
    assert (found._reason, found._forced_s) == ("Ctrl-C", forced_s)
    found._enforce_end(forced_s + 0.9 * FORCED_END_S)
    assert killed == []
    found._enforce_end(forced_s + 1.1 * FORCED_END_S)
    assert killed == [(4711, signal.SIGKILL)]
    found._has_parent_ended = True
    found._enforce_end(forced_s + 1.1 * FORCED_END_S)
    assert len(killed) == 1


def test_arms_that_do_not_close_are_killed():
    """After the timeout, each process that has not ended is."""
    left, right = arms()
    right.is_gone = True
    found = made(left, right)
    found._enforce_end(100.0)
    found.close()
    found._enforce_end(found._closed_s + 0.9 * CLOSE_S)
    assert not left.process.is_killed
    found._enforce_end(found._closed_s + 1.1 * CLOSE_S)
    assert (left.process.is_killed, right.process.is_killed) == (True, False)


@pytest.mark.parametrize(("is_moving", "limit_s"), [(True, HANG_LIMIT_S), (False, REST_HANG_LIMIT_S)])
def test_supervisor_that_did_not_run_stops_all_arms(is_moving, limit_s):
    """It cannot tell what happened meanwhile; each cycle begins the time anew."""
    for factor in (0.8, 1.2):
        left, right = arms()
        right.is_moving = is_moving
        found = made(left, right)
        found._standstill._cycle_s -= factor * limit_s
        found._check_standstill()
        assert found._reason.startswith("the process that supervises the arms did not run for") == (factor > 1)
        assert found._standstill.duration_s < 0.1


def test_reports_of_an_arm_are_noted_and_passed_on():
    """States, answers and openings reach the capture with the number of the arm; the others are for the supervisor."""
    (left,), right = arms(1), _Arm(1, "right", Process(), Link(), 3.0)
    found = made(left, right)
    assert (right.is_open, right.stops_if_killed, right.is_moving, right.read_s) == (False, True, False, None)
    reports = (
        Frame(Kind.OPENED, 0, pickle.dumps({"stops_if_killed": False})),
        Frame(Kind.ALIVE, 0, bytes([1])),
        Frame(Kind.READING, 0, b"state"),
        Frame(Kind.ANSWER, 0, b"answer"),
        Frame(Kind.FAILED, 0, b"error"),
    )
    for frame in reports:
        found._handle_report(right, frame)
    assert not right.has_stopped
    found._handle_report(right, Frame(Kind.STOPPED, 0, b""))
    assert [(frame.kind, frame.arm) for frame in found._parent.sent] == [
        (Kind.OPENED, 1), (Kind.READING, 1), (Kind.ANSWER, 1), (Kind.FAILED, 1),
    ]  # fmt: skip
    assert (right.is_open, right.stops_if_killed, right.is_moving, right.read_s) == (True, False, True, 3.0)
    assert (right.has_stopped, left.has_stopped, found._stopped_s) == (True, False, None)
    found._handle_report(right, Frame(Kind.ALIVE, 0, bytes([0])))
    assert not right.is_moving
    found._handle_report(right, Frame(Kind.TROUBLE, 0, b"right: protective stop"))
    assert found._reason == "right: protective stop"


@pytest.mark.parametrize(("code", "cause"), [(0, "exit code 0"), (3, "exit code 3"), (-9, "signal 9")])
def test_driver_that_ends_stops_all_arms(code, cause):
    """Its end is reported with its cause; after a close it is expected."""
    for is_closed in (False, True):
        left, right = arms()
        right.process.code = code
        found = made(left, right, _closed_s=1.0 if is_closed else None)
        left.channel.frames = [Frame(Kind.ALIVE, 0, bytes([1]))]
        found._receive_from_arm(left)
        for _ in range(2):
            found._receive_from_arm(right)
        assert left.is_moving
        assert right.is_gone
        assert found._reason == ("" if is_closed else f"right: the process of its driver ended ({cause})")


def test_capture_that_ends_stops_and_closes_the_arms():
    """Also without a request to close them; its pipe is not read again."""
    pipes = [0]
    found = made(*arms(), _ready=SimpleNamespace(unregister=pipes.remove))
    found._parent.frames = [Frame(Kind.ALIVE, 0, b"")]
    found._receive_from_parent()
    assert (found._reason, found._has_parent_ended, found._closed_s) == ("", False, None)
    assert found._parent_heard_s > 0
    for _ in range(2):
        found._receive_from_parent()
    assert found._reason == "the capture ended without closing the arms"
    assert [arm.channel.kinds() for arm in found._arms] == [[Kind.STOP, Kind.CLOSE]] * 2
