"""Tests of the monitor of a loop."""

from __future__ import annotations

import time

import pytest

from basecal.acquisition.supervision.standstill import Standstill, standstill_reason

pytestmark = pytest.mark.timed


def test_duration_begins_with_the_last_cycle():
    """It increases while the loop does not run, and each cycle resets it."""
    standstill = Standstill()
    time.sleep(0.1)
    assert 0.1 <= standstill.duration_s < 0.3
    standstill.end_cycle()
    assert standstill.duration_s < 0.1


def test_reason_names_the_process():
    """It has the duration to a tenth of a second."""
    assert standstill_reason("the capture", 45.02) == "the capture did not run for 45.0 s"
