"""Tests of the running check in a thread."""

from __future__ import annotations

import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from basecal.acquisition.running import background as module
from basecal.acquisition.running.background import BackgroundCheck, Checked
from basecal.acquisition.running.check import Doubt
from shared.running_samples import recorded

TESTS = Path(__file__).parents[2]
pytestmark = pytest.mark.timed


class Slow:
    """Check that waits for permission, and doubts each sample."""

    estimate = None

    def __init__(self, cell):
        self.go = threading.Event()

    def add(self, sample):
        self.go.wait(10)
        return (Doubt(sample.sample, "wrong", is_lasting=False),)


def test_capture_does_not_wait_for_a_slow_check(monkeypatch):
    """Late results are reported later, once, in the order of the samples."""
    monkeypatch.setattr(module, "RunningCheck", Slow)
    monkeypatch.setattr(module, "_PATIENCE_S", 0.05)
    cell, samples = recorded(3)
    with BackgroundCheck(cell) as check:
        began = time.monotonic()
        for sample in samples:
            check.add(sample)
        early = check.collect()
        assert (early.doubts, early.unchecked) == ((), 3)
        assert time.monotonic() - began < 5
        check._check.go.set()
        late = check.collect(waits=True)
        assert ([doubt.sample for doubt in late.doubts], late.unchecked) == ([0, 1, 2], 0)
        assert check.collect(waits=True).doubts == ()


def test_capture_waits_for_a_usual_check():
    """A check that takes a tenth of a second ends before the capture goes on, so that a sample can be repeated."""
    asked = []

    class Usual:
        """Check that ends if it is waited for."""

        def result(self, timeout):
            asked.append(timeout)
            if timeout < 0.1:
                raise module.Unfinished
            return Checked((1e-3, 1e-3))

    check = BackgroundCheck.__new__(BackgroundCheck)
    check._running, check._sigma = [Usual()], None
    assert check.collect() == Checked((1e-3, 1e-3))
    assert max(asked) < 1.0


def test_failed_check_is_raised_to_the_caller(monkeypatch):
    """The next samples are checked."""

    class Failing(Slow):
        def add(self, sample):
            if sample.sample == 0:
                raise ValueError("no check")
            return ()

    monkeypatch.setattr(module, "RunningCheck", Failing)
    cell, samples = recorded(2)
    with BackgroundCheck(cell) as check:
        for sample in samples:
            check.add(sample)
        with pytest.raises(ValueError, match="no check"):
            check.collect(waits=True)
        del check._running[0]
        assert check.collect(waits=True).doubts == ()


HANGS = """
import time
from pathlib import Path
from basecal.acquisition.running import background as module
from shared.running_samples import recorded

class Hanging:
    estimate = None
    def __init__(self, cell): ...
    def add(self, sample): time.sleep(600)

module.RunningCheck = Hanging
cell, samples = recorded(1)
with module.BackgroundCheck(cell) as check:
    check.add(samples[0])
    print("left", flush=True)
"""


def test_hanging_check_does_not_delay_the_exit():
    """The process ends although the check does not: Ctrl-C ends a capture at once."""
    ended = subprocess.run([sys.executable, "-c", HANGS], cwd=TESTS, capture_output=True, text=True, timeout=60)
    assert (ended.returncode, ended.stdout, ended.stderr) == (0, "left\n", "")
