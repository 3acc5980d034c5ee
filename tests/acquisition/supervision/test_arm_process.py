"""Tests of the judgements of an arm's process."""

from __future__ import annotations

import os
import pickle
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

from basecal.acquisition.driver import Place, Reading
from basecal.acquisition.supervision import arm_process
from basecal.acquisition.supervision.arm_process import ArmProcess, _error_text
from basecal.acquisition.supervision.frames import Channel, Kind
from basecal.acquisition.supervision.limits import HANG_LIMIT_S, HOLD_S, STALE_S
from basecal.cell import Cell, Robot, RobotState
from basecal.errors import DriverError
from basecal.simulation.arms import six_axis

HOME = RobotState(joints_rad=np.zeros(2))
GOAL = RobotState(joints_rad=np.ones(2))


class Arm:
    """Robot that records stops."""

    is_live, is_connected = True, True

    def __init__(self):
        self.stops = 0

    def move(self, to, speed_rad_s):
        pass

    def stop(self):
        self.stops += 1


@pytest.fixture
def served():
    """An arm's process run in this one, its robot, and its messages."""
    read_fd, write_fd = os.pipe()
    idle_fd, hold_fd = os.pipe()
    process = ArmProcess(Channel(idle_fd, write_fd))
    process._robot, process._name = Arm(), "left"
    os.set_blocking(read_fd, False)
    heard = Channel(read_fd, hold_fd)
    yield process, process._robot, heard
    for channel in (heard, process._channel):
        channel.close()


def read(process, state, lag_s=0.0):
    """Let it read a state with a given delay."""
    process._read_s = time.monotonic()
    reading = Reading(process._read_s - lag_s, state)
    process._check_lag(reading)
    process._note(reading)


def troubles(heard):
    """Reasons for which it requests a stop of all arms."""
    return [frame.payload.decode() for frame in heard.receive() if frame.kind == Kind.TROUBLE]


def test_arm_moves_until_it_settles_at_its_goal(served):
    """It moves from the request until ten states in a row are at the goal."""
    process, robot, _ = served
    assert not process._is_moving
    process._call_driver(robot, "move", (GOAL, 1.0))
    read(process, HOME)
    for _ in range(9):
        read(process, GOAL)
        assert process._is_moving
    read(process, GOAL)
    assert not process._is_moving


def test_blocked_arm_is_reported(served):
    """It is reported if it rests away from its goal for two seconds, and not earlier."""
    process, robot, heard = served
    read(process, HOME)
    process._call_driver(robot, "move", (GOAL, 1.0))
    process._supervisor_s = process._read_s = time.monotonic() + HOLD_S
    process._check_timeouts(time.monotonic() + 0.9 * HOLD_S)
    assert troubles(heard) == []
    process._check_timeouts(time.monotonic() + 1.1 * HOLD_S)
    assert [why.partition(". Look")[0] for why in troubles(heard)] == ["left: it is at rest, but not at its goal"]


def test_late_states_count_during_motions(served):
    """A delay of half a second is too long during a motion; at rest it does not matter."""
    process, robot, _ = served
    read(process, HOME)
    read(process, HOME, lag_s=5.0)
    process._call_driver(robot, "move", (GOAL, 1.0))
    read(process, HOME, lag_s=0.9 * STALE_S)
    with pytest.raises(DriverError, match=r"left: its states came 0\.5 s late while it moved"):
        read(process, HOME, lag_s=1.1 * STALE_S)


def test_slow_controller_clock_is_no_slow_link(served):
    """At 100 ppm its stamps fall behind by a second in three hours; a late state is still reported then."""
    process, robot, _ = served
    begin_s = time.monotonic()

    def read_after(elapsed_s, late_s=0.0):
        process._read_s = begin_s + elapsed_s
        process._check_lag(Reading(1000 + elapsed_s * (1 - 1e-4) - late_s, HOME))

    for hour in np.arange(0, 3, 0.01):
        read_after(3600 * hour)
    process._call_driver(robot, "move", (GOAL, 1.0))
    read_after(3 * 3600)
    with pytest.raises(DriverError, match=r"left: its states came 0\.5 s late while it moved"):
        read_after(3 * 3600 + 1, late_s=0.5)


def test_arm_off_its_path_is_reported(served):
    """A joint may overshoot by a degree; three degrees beyond start and goal end the capture."""
    process, robot, _ = served
    read(process, HOME)
    process._call_driver(robot, "move", (GOAL, 1.0))
    read(process, RobotState(joints_rad=np.array([1.02, -0.02])))
    with pytest.raises(DriverError, match=r"left: joint 2 is 5\.73 deg beyond its path\. Look for a person or"):
        read(process, RobotState(joints_rad=np.array([0.5, -0.1])))


def test_arm_that_leaves_its_goal_is_reported(served):
    """The limit is 10 mrad, until it gets another goal or is released."""
    process, robot, _ = served
    read(process, HOME)
    process._call_driver(robot, "move", (GOAL, 1.0))
    for _ in range(10):
        read(process, GOAL)
    assert not process._is_moving
    read(process, RobotState(joints_rad=np.array([0.991, 1.009])))
    with pytest.raises(DriverError, match=r"left: joint 1 is 0\.63 deg beyond its path"):
        read(process, RobotState(joints_rad=np.array([0.989, 1.0])))
    process._call_driver(robot, "move", (HOME, 1.0))
    read(process, RobotState(joints_rad=np.array([0.5, 0.5])))


def test_arm_without_a_goal_may_be_at_any_place(served):
    """A person may guide it to any place."""
    process, _, heard = served
    read(process, HOME)
    read(process, RobotState(joints_rad=np.array([2.0, -2.0])))
    assert troubles(heard) == []


def test_library_error_is_reported_as_link_or_driver():
    """Its message follows its meaning; an error of this package is unchanged."""
    lost = "left: its link is lost, or its driver failed (RuntimeError: End of file)"
    assert _error_text("left", RuntimeError("End of file")) == lost
    assert _error_text("left", DriverError("left: protective stop")) == "left: protective stop"
    assert _error_text("left", BrokenPipeError(32, "Broken pipe")) == "left: its connection was closed (Broken pipe)"


def test_another_number_of_joints_is_reported(served):
    """As what it is, and not as the error of an array; the arm is stopped."""
    process, robot, heard = served
    states = iter([6, 6, 3])
    robot.state = lambda: Reading(time.monotonic(), RobotState(joints_rad=np.zeros(next(states))))
    process._read(robot, Place("left", Cell("left", {"left": Robot("left", chain=six_axis())}), Path(".")))
    (trouble,) = troubles(heard)
    assert trouble.startswith("left: its driver reports 3 joints, its chain in cell.yaml has 6:")


def test_closed_connection_stops_the_arm(served, monkeypatch):
    """It is reported, the arm stops, and the process ends: a library might connect again and send its program."""
    process, robot, heard = served
    ended = threading.Event()
    monkeypatch.setattr(arm_process.os, "_exit", lambda code: ended.set())
    process._call_driver(robot, "move", (GOAL, 1.0))
    robot.is_connected = False
    process._check_timeouts(time.monotonic())
    assert troubles(heard) == ["left: its connection was closed while it moved"]
    assert ended.wait(2)
    assert robot.stops == 1
    assert process._call_driver(robot, "move", (GOAL, 1.0)) is None


def wait_for_stop(robot):
    """Wait until the robot is stopped."""
    until = time.monotonic() + 2
    while not robot.stops and time.monotonic() < until:
        time.sleep(0.01)
    assert robot.stops == 1


def test_silent_supervisor_stops_a_moving_arm(served):
    """Without a heartbeat for 0.4 s it is stopped, and so are the others once the supervisor runs again."""
    process, robot, heard = served
    process._check_timeouts(time.monotonic() + 1.1 * HANG_LIMIT_S)
    process._call_driver(robot, "move", (GOAL, 1.0))
    process._check_timeouts(time.monotonic() + 0.9 * HANG_LIMIT_S)
    assert (robot.stops, troubles(heard)) == (0, [])
    process._check_timeouts(time.monotonic() + 1.1 * HANG_LIMIT_S)
    wait_for_stop(robot)
    assert troubles(heard) == ["the process that supervises the arms was silent for 0.4 s, while they moved"]


@pytest.mark.parametrize(("moves", "gap_s", "is_reported"), [
    (False, 9.0, False), (False, 11.0, True), (True, 0.2, False), (True, 0.7, True),
])  # fmt: skip
def test_process_that_did_not_run_is_the_reason(served, moves, gap_s, is_reported):
    """Its arm is stopped after ten seconds at rest, after 0.4 s in a motion: it cannot judge link and driver."""
    process, robot, heard = served
    if moves:
        process._call_driver(robot, "move", (GOAL, 1.0))
    process._standstill._cycle_s -= gap_s
    process._check_standstill()
    process._check_standstill()
    assert len(troubles(heard)) == is_reported
    assert process._must_stop == is_reported
    process._standstill._cycle_s -= gap_s
    process._report("left: its link is lost")
    assert troubles(heard) == [
        f"left: the process of its driver did not run for {gap_s:.1f} s" if is_reported else "left: its link is lost"
    ]


@pytest.mark.parametrize("is_ordered_before", [True, False])
def test_arm_is_stopped_before_it_is_closed(served, monkeypatch, is_ordered_before):
    """Both requests come together if the capture ended; a closed driver could not stop the arm."""
    process, robot, _ = served
    orders = []
    monkeypatch.setattr(arm_process.os, "_exit", lambda code: orders.append("exit"))
    robot.stop, robot.close = lambda: (time.sleep(0.1), orders.append("stop")), lambda: orders.append("close")
    process._call_driver(robot, "move", (GOAL, 1.0))
    if is_ordered_before:
        process._stop()
    process._end()
    assert orders == ["stop", "close", "exit"]


def test_request_that_waits_at_the_end_is_not_executed(served, monkeypatch):
    """If the supervisor ends right after it passed a motion on, the motion does not begin."""
    process, robot, _ = served
    moves = []
    monkeypatch.setattr(arm_process.os, "_exit", lambda code: None)
    robot.move, robot.close = lambda to, speed_rad_s: moves.append(to), lambda: None
    process._end()
    assert process._call_driver(robot, "move", (GOAL, 1.0)) is None
    assert moves == []


def test_option_that_is_no_number_is_an_error(served, monkeypatch):
    """The arm does not open, and the waiting caller gets the reason."""
    process, robot, heard = served
    monkeypatch.setattr(arm_process, "_find_driver", lambda place: None)
    monkeypatch.setattr(arm_process, "_open_robot", lambda kind, place: robot)
    place = Place("left", Cell("left", {"left": Robot("left")}), Path("."), {"reconnect_s": "soon"})
    process._open(pickle.dumps((place, sys.path)))
    (frame,) = heard.receive()
    kind, words, _ = pickle.loads(frame.payload)
    assert frame.kind == Kind.FAILED
    assert kind is DriverError
    assert words.startswith("left: its driver failed (ValueError: could not convert string to float: 'soon'")


def test_answer_that_cannot_be_sent_is_an_error(served):
    """The caller gets an error instead of waiting; the next request is answered."""
    process, robot, heard = served
    robot.goal_refusal = lambda to: "too far" if to is GOAL else threading.Lock()
    threading.Thread(target=process._serve_requests, args=(robot,), daemon=True).start()
    for number, goal in enumerate((HOME, GOAL)):
        process._requests.put((number, "goal_refusal", (goal,)))
    answers, until = [], time.monotonic() + 2
    while len(answers) < 2 and time.monotonic() < until:
        answers += [pickle.loads(frame.payload) for frame in heard.receive() if frame.kind == Kind.ANSWER]
    assert [number for number, _, _ in answers] == [0, 1]
    assert answers[0][2][1].startswith("left: its driver failed (TypeError: cannot pickle")
    assert answers[1][1:] == ("too far", None)


def test_motion_started_during_a_stop_is_stopped(served):
    """The stop may reach the controller before a request in progress; then it is sent again."""
    process, robot, heard = served
    orders = []

    def move(to, speed_rad_s):
        process._stop()
        until = time.monotonic() + 2
        while not orders and time.monotonic() < until:
            time.sleep(0.01)
        orders.append("move")

    robot.move, robot.stop = move, lambda: orders.append("stop")
    process._call_driver(robot, "move", (GOAL, 1.0))
    assert orders == ["stop", "move", "stop"]
    assert Kind.STOPPED in [frame.kind for frame in heard.receive()]


def test_arm_with_active_freedrive_counts_as_moving(served):
    """A stop ends its freedrive again."""
    process, _, heard = served
    orders = []

    class Guided:
        is_live = True

        def freedrive(self, on):
            orders.append(on)
            if orders.count(False) == 1 and not on:
                raise DriverError("left: the controller did not end freedrive")

    process._robot = robot = Guided()
    process._call_driver(robot, "freedrive", (True,))
    with pytest.raises(DriverError, match="did not end freedrive"):
        process._call_driver(robot, "freedrive", (False,))
    assert process._is_moving
    process._stop_robot()
    assert orders == [True, False, False]
    assert [frame.kind for frame in heard.receive()] == [Kind.STOPPED]
    process._call_driver(robot, "freedrive", (False,))
    assert not process._is_moving
