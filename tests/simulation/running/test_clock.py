"""The time of a running cell."""

from __future__ import annotations

import time

from basecal.simulation.running.clock import Clock


def test_time_goes_on_as_it_is_spent():
    """At speed 0 only waiting passes time, exactly as much, at once."""
    clock, began = Clock(0), time.monotonic()
    assert [clock.time_s(), clock.wait(1000.0), clock.time_s()] == [0.0, 1000.0, 1000.0]
    assert time.monotonic() - began < 10


def test_time_goes_faster():
    """At speed 100 a second of waiting is over in a hundredth of one, and time passes by itself."""
    clock, began = Clock(100), time.monotonic()
    assert clock.wait(1.0) >= 1.0
    assert time.monotonic() - began < 1.0
    before = clock.time_s()
    time.sleep(0.01)
    assert clock.time_s() - before >= 1.0
