"""Tests of the promises of drivers."""

from __future__ import annotations

import threading
import time
from types import SimpleNamespace

import numpy as np
import pytest

from basecal.acquisition.driver import Reading
from basecal.acquisition.driver_check import promises
from basecal.acquisition.driver_check.promises import (
    Arrivals,
    _guarantee_promise,
    _stream_promises,
    count_stale_images,
    measure_stop,
    record_images,
)
from basecal.cell import RobotState
from basecal.errors import DriverError


def test_each_fault_of_a_stream_breaks_its_own_promise():
    """A correct stream keeps all; a slow one, a fast clock and decreasing stamps break one promise each."""
    at_s = np.arange(501) * 0.01

    def broken(at_s, stamps_s):
        return [each.promise for each in _stream_promises(Arrivals(at_s, stamps_s), 10.0) if not each.holds]

    assert broken(at_s, at_s) == []
    assert broken(20 * at_s, 20 * at_s) == ["at least 10 in a second"]
    assert broken(at_s, 1.02 * at_s) == ["clock within 1% of this machine's"]
    back = at_s.copy()
    back[250] -= 0.05
    assert broken(at_s, back) == ["stamps do not go back"]
    assert "no gap longer than 0.45 s" in broken(np.append(at_s, 6.0), np.append(at_s, 6.0))


def test_arrivals_are_summarised():
    """A clock 2 % fast with one repeated stamp and one late state is measured as such."""
    at_s = np.arange(101) * 0.01
    stamps_s = 50 + 1.02 * at_s
    arrivals = Arrivals(at_s, stamps_s)
    assert arrivals.rate_hz == pytest.approx(100)
    assert arrivals.drift == pytest.approx(0.02)
    assert (arrivals.repeats, arrivals.steps_back) == (0, 0)
    at_s, stamps_s = at_s.copy(), 50 + at_s
    at_s[-1], stamps_s[50], stamps_s[70] = 1.3, stamps_s[49], 50.0
    arrivals = Arrivals(at_s, stamps_s)
    assert arrivals.longest_gap_s == pytest.approx(0.31)
    assert arrivals.lag_s == pytest.approx(0.7)
    assert (arrivals.repeats, arrivals.steps_back) == (1, 1)


@pytest.mark.timed
@pytest.mark.parametrize("waiting", [0, 4])
def test_buffered_images_are_counted(waiting):
    """Images that arrive faster than exposures come from a buffer."""
    left = [waiting]

    def image():
        left[0] -= 1
        if left[0] < 0:
            time.sleep(0.3)

    assert count_stale_images(SimpleNamespace(image=image), 0.3, 0.0) == max(waiting - 1, 0)


@pytest.mark.parametrize(("guarantee", "words"), [
    ("none", "the arm finishes its move if this computer is silent"),
    ("watchdog", "declared by the driver, not measured"),
    ("short-horizon", "declared by the driver, not measured"),
])  # fmt: skip
def test_missing_guarantees_are_reported(guarantee, words):
    """A declared guarantee does not count as measured."""
    found = _guarantee_promise("arm", object(), guarantee, is_motion_allowed=True)
    assert (found.measured, found.holds) == (words, None)


@pytest.mark.parametrize("count", [2, 3])
def test_measurement_needs_three_states(monkeypatch, count):
    """For fewer, their number is reported."""
    times_s = iter([0.0, *np.linspace(0.1, 1.0, count)])
    monkeypatch.setattr(promises, "time", SimpleNamespace(monotonic=lambda: next(times_s)))
    camera = SimpleNamespace(image=lambda: SimpleNamespace(stamp_s=7.0))
    if count == 3:
        np.testing.assert_allclose(record_images(camera, 1.0).arrivals_s, [0.1, 0.55, 1.0])
        return
    with pytest.raises(DriverError, match="only 2 of the 3 states or images that are needed came in 1 s"):
        record_images(camera, 1.0)


def test_heartbeats_end_on_request(monkeypatch):
    """Heartbeats run from the start, and end on request, at the latest with the context."""
    monkeypatch.setattr(promises, "_HEARTBEAT_S", 1e-3)

    class Watched:
        """Robot that counts heartbeats."""

        def __init__(self):
            self.count, self.third = 0, threading.Event()

        def keep_alive(self):
            """Count a heartbeat."""
            self.count += 1
            if self.count >= 3:
                self.third.set()

    for is_ended_early in (True, False):
        robot = Watched()
        with promises._heartbeats(robot) as end:
            assert robot.third.wait(5.0)
            if is_ended_early:
                end()
                time.sleep(0.01)
                count = robot.count
                time.sleep(0.01)
                assert robot.count == count
        time.sleep(0.01)
        count = robot.count
        time.sleep(0.01)
        assert robot.count == count
    with promises._heartbeats(SimpleNamespace()) as end:
        end()


@pytest.mark.parametrize(("sigma", "is_kept"), [(0.5, True), (2.0, False)])
def test_arm_at_rest_scatters_little(monkeypatch, sigma, is_kept):
    """Its states scatter by less than the tolerance of arrival."""
    at_s = np.arange(100) * 0.01
    values = np.tile([[-1.0], [1.0]], (50, 6)) * sigma * promises.ARRIVED_RAD_M
    monkeypatch.setattr(promises, "record_states", lambda name, robot, duration_s: (Arrivals(at_s, at_s), values))
    found = promises.robot_promises("arm", SimpleNamespace(is_live=True), "none", False)
    assert next(each for each in found if each.promise.startswith("noise at rest")).holds == is_kept


class Arm:
    """Arm of three joints that makes a tenth of its motion with each state, and two tenths after a stop."""

    def __init__(self):
        self.begin = self.joints = self.goal = np.array([0.3, -0.2, 0.1])
        self.left = 0
        self.stopped_at = None

    def state(self):
        """Move on, and report the joints."""
        if self.left:
            self.joints, self.left = self.joints + (self.goal - self.begin) / 10, self.left - 1
        return Reading(time.monotonic(), RobotState(joints_rad=self.joints))

    def move(self, to, speed_rad_s):
        """Begin a motion."""
        self.goal, self.left = to.joints_rad, 10

    def stop(self):
        """End the motion two states later."""
        if self.stopped_at is None:
            self.stopped_at, self.left = self.joints, 2


def test_last_joint_is_stopped_half_way(monkeypatch):
    """Only the last joint moves. The order comes after half of its motion, and the distance from there is measured."""
    monkeypatch.setattr(promises, "_REST_S", 0.01)
    arm = Arm()
    stop = measure_stop("arm", arm, 0.05, 0.1)
    np.testing.assert_allclose(arm.goal - arm.begin, [0, 0, 0.05])
    assert 0.025 < arm.stopped_at[2] - arm.begin[2] < 0.05
    assert stop.distance_rad == pytest.approx(0.01)
    assert 0 <= stop.time_s < 1.0
