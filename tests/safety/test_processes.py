"""Tests of captures whose processes end, hang or get a signal while arms move."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import time
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest

from safety.installed_driver import installed_driver
from shared.second_process import TESTS, second_process

pytestmark = [
    pytest.mark.timed,
    pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="processes are found by /proc"),
]
TOLD_S = 0.3
WATCHDOG_S = 0.5


@contextmanager
def moving(tmp_path, *words):
    """Controllers, the process of a capture whose arms move, and its process ids."""
    with (
        installed_driver(tmp_path / "packages", "frail", TESTS / "safety" / "frail_driver.py") as folder,
        second_process("safety.frail_controllers") as controllers,
    ):
        ports = json.loads(controllers.tell("ports"))
        command = [sys.executable, "-m", "safety.moving_arms", folder, *ports.values(), *words]
        environment = {**os.environ, "PYTHONPATH": f"{TESTS.parent / 'src'}:{TESTS.parent}"}
        with subprocess.Popen(
            list(map(str, command)),
            cwd=TESTS,
            env=environment,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        ) as capture:
            try:
                numbers = json.loads(capture.stdout.readline())
                time.sleep(0.2)
                yield controllers, capture, numbers
            finally:
                capture.kill()


def halts(controllers, since_s):
    """Time and cause of each arm's halt after an instant, by name."""
    log = json.loads(controllers.tell("log"))
    return {
        name: next(((at - since_s, what) for at, what in lines if at >= since_s and what.startswith("halted")), None)
        for name, lines in log.items()
    }


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGHUP, signal.SIGTERM])
def test_signals_stop_both_arms(tmp_path, number):
    """Ctrl-C, a closed terminal and `kill` stop both arms at once, and the capture ends within two seconds."""
    with moving(tmp_path) as (controllers, capture, _):
        since_s = time.monotonic()
        capture.send_signal(number)
        capture.wait(2)
        found = halts(controllers, since_s)
    assert {name: why for name, (_, why) in found.items()} == {"left": "halted stop", "right": "halted stop"}
    assert max(at for at, _ in found.values()) < TOLD_S


def test_stop_from_another_thread_stops_both_arms(tmp_path):
    """A stop requested by the button of the page stops both arms at once; the capture ends with that reason."""
    with moving(tmp_path) as (controllers, capture, _):
        since_s = time.monotonic()
        _, said = capture.communicate("pressed\n", timeout=4)
        found = halts(controllers, since_s)
    assert {name: why for name, (_, why) in found.items()} == {"left": "halted stop", "right": "halted stop"}
    assert max(at for at, _ in found.values()) < TOLD_S
    assert "DriverError: Stop was pressed. left and right confirmed the stop." in said


@pytest.mark.parametrize("victim", ["capture", "supervisor", "left", "right"])
@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGSTOP])
def test_arms_stop_if_any_process_dies_or_hangs(tmp_path, victim, number):
    """If any process is killed or stopped, each arm is at rest within 0.5 s, or 1.3 s if the process hangs."""
    with moving(tmp_path) as (controllers, capture, numbers):
        left, right = numbers["arms"]
        pids = {"capture": capture.pid, "supervisor": numbers["supervisor"][0], "left": left, "right": right}
        since_s = time.monotonic()
        os.kill(pids[victim], number)
        try:
            if victim != "capture":
                capture.wait(4)
            time.sleep(1.6)
            found = halts(controllers, since_s)
        finally:
            for pid in pids.values():
                kill(pid)
    allowed = WATCHDOG_S if number == signal.SIGKILL else 1.3 if victim == "capture" else 0.9
    assert max(at for at, _ in found.values()) < allowed, found
    others = {"left", "right"} - {victim}
    if number == signal.SIGKILL:
        assert all(found[name][0] < TOLD_S for name in others), found


def test_standstill_of_all_processes_is_the_reason(tmp_path):
    """If a frozen machine goes on, its processes name that, and neither the link of an arm nor its driver."""
    with moving(tmp_path) as (_, capture, numbers):
        pids = [capture.pid, *numbers["supervisor"], *numbers["arms"]]
        for number in (signal.SIGSTOP, signal.SIGCONT):
            for pid in pids:
                os.kill(pid, number)
            time.sleep(0.7)
        _, said = capture.communicate(timeout=4)
    assert re.search(r"DriverError: .*process .* did not run for 0\.\d s\. left and right confirmed the stop\.", said)


def kill(pid):
    """Kill a process if it still runs."""
    with suppress(ProcessLookupError):
        os.kill(pid, signal.SIGKILL)


def test_second_ctrl_c_ends_a_hanging_capture(tmp_path):
    """The first stops the arms although the capture holds Python's lock; the second ends it within two seconds."""
    with moving(tmp_path, "hang") as (controllers, capture, _):
        since_s = time.monotonic()
        capture.send_signal(signal.SIGINT)
        time.sleep(0.5)
        found = halts(controllers, since_s)
        assert capture.poll() is None
        capture.send_signal(signal.SIGINT)
        capture.wait(2)
    assert max(at for at, _ in found.values()) < TOLD_S
