"""The running check in a thread."""

from __future__ import annotations

import threading
import time

import pytest

from basecal.acquisition.running import background as module
from basecal.acquisition.running.background import BackgroundCheck
from basecal.acquisition.running.check import Doubt
from shared.running_samples import recorded

pytestmark = pytest.mark.timed


class Slow:
    """A check that waits until it may go on, and doubts every sample."""

    estimate = None

    def __init__(self, cell):
        self.go = threading.Event()

    def add(self, sample):
        self.go.wait(10)
        return (Doubt(sample.sample, "wrong", is_lasting=False),)


def test_the_capture_does_not_wait_for_a_slow_check(monkeypatch):
    """What is not known yet is found later, once, and in the order of the samples."""
    monkeypatch.setattr(module, "RunningCheck", Slow)
    monkeypatch.setattr(module, "_PATIENCE_S", 0.05)
    cell, samples = recorded(3)
    with BackgroundCheck(cell) as check:
        began = time.monotonic()
        for sample in samples:
            check.add(sample)
        assert check.found().doubts == ()
        assert time.monotonic() - began < 5
        check._check.go.set()
        assert [doubt.sample for doubt in check.found(waits=True).doubts] == [0, 1, 2]
        assert check.found(waits=True).doubts == ()
