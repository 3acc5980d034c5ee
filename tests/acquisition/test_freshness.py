"""Tests of the arrival and rate of states."""

from __future__ import annotations

import time

import pytest

from basecal.acquisition import freshness
from basecal.acquisition.freshness import Patience, Stale, Waits, wait_for_newer
from basecal.errors import DriverError


def test_new_data_are_returned():
    """The source is polled until it has data."""
    given = iter([None, None, 3])
    assert wait_for_newer(lambda: next(given), 1.0) == 3


def test_missing_data_are_stale():
    """After the timeout, Stale is raised."""
    with pytest.raises(Stale):
        wait_for_newer(lambda: None, 0.02)


def test_low_rate_is_refused_with_its_number():
    """Four states a second are refused after five seconds; the message has the measured and the required rate."""
    waits = Waits("eye")
    for _ in range(21):
        waits.add(0.25)
    with pytest.raises(DriverError, match=r"eye: only 4 states in a second came for 5\.2 s, at least 10 are needed"):
        waits.add(0.25)


@pytest.mark.parametrize("outage_s", [1.4, 9.0])
def test_one_outage_is_tolerated(outage_s):
    """An outage of any length counts as one wait that is left out; so does a short drop of the rate."""
    waits = Waits("eye")
    for wait_s in [*20 * [0.008], outage_s, *20 * [0.008], *12 * [1.4 / 12], *20 * [0.008]]:
        waits.add(wait_s)


def test_repeated_outages_are_a_low_rate():
    """Consecutive gaps of two seconds are a rate that is too low, and no outage."""
    waits = Waits("eye")
    with pytest.raises(DriverError, match=r"eye: only 0\.5 states in a second"):
        [waits.add(2.0) for _ in range(6)]


def test_ten_states_a_second_are_enough():
    """Infrequent requests wait less, and are accepted."""
    waits = Waits("eye")
    for wait_s in 300 * [0.0999]:
        waits.add(wait_s)


def test_patience_uses_the_stamps():
    """Half a second of stamps may pass at once, and the clock is not blamed."""
    waited = Patience(0.5)
    assert not any(waited.is_over(stamp_s) for stamp_s in (7.0, 7.2, 7.4))
    assert waited.is_over(7.6)
    assert waited.cause == ""


@pytest.mark.parametrize("step_s", [0.0, -1.0])
def test_patience_ends_if_stamps_do_not_advance(step_s):
    """If stamps repeat or go back, this machine's clock counts, and the cause is reported."""
    waited, stamp_s, began_s = Patience(0.05), 7.0, time.monotonic()
    while not waited.is_over(stamp_s):
        stamp_s += step_s
        assert time.monotonic() - began_s < 10
    assert time.monotonic() - began_s >= 0.05
    assert waited.cause == " (the stamps of its states do not advance)"


class Clock:
    """Clock that sleeping advances."""

    def __init__(self):
        self.now_s, self.slept = 100.0, 0

    def monotonic(self):
        return self.now_s

    def sleep(self, time_s):
        self.now_s += time_s
        self.slept += 1


@pytest.fixture
def clock(monkeypatch):
    """Replace the clock of the module."""
    made = Clock()
    monkeypatch.setattr(freshness, "time", made)
    return made


def test_available_data_are_returned_at_once(clock):
    """There is no pause, also for zero; data that arrive at the timeout are returned."""
    assert wait_for_newer(lambda: 0, 0.0) == 0
    assert clock.slept == 0
    given = iter([None, "late"])
    assert wait_for_newer(lambda: next(given), 0.0) == "late"


@pytest.mark.parametrize("wait_s", [0.25, None])
def test_data_are_polled_until_the_timeout(clock, wait_s):
    """Polling is faster than any robot sends, and the default timeout is a second."""
    with pytest.raises(Stale):
        wait_for_newer(lambda: None, **({} if wait_s is None else {"wait_s": wait_s}))
    assert clock.now_s - 100.0 == pytest.approx(wait_s or 1.0, abs=2e-3)
    assert clock.slept >= 500 * (wait_s or 1.0)


@pytest.mark.parametrize(("wait_s", "is_enough"), [(0.099, True), (0.1015, False)])
def test_rate_is_measured_over_five_seconds(wait_s, is_enough):
    """The limit is ten a second; states before the last five seconds do not count."""
    waits = Waits("eye")
    for each_s in (*15 * [0.3], *51 * [0.01]):
        waits.add(each_s)
    if is_enough:
        for _ in range(100):
            waits.add(wait_s)
    else:
        with pytest.raises(DriverError, match=r"eye: only 9\.9 states in a second came for 5\.1 s"):
            [waits.add(wait_s) for _ in range(100)]


def test_waits_before_a_lost_connection_do_not_count():
    """The rate was too low for four seconds before and after."""
    waits = Waits("eye")
    for _ in range(2):
        for _ in range(16):
            waits.add(0.25)
        waits.forget()
        waits.forget()


def test_patience_is_over_beyond_the_limit(clock):
    """The limit itself is within; advances of stamps and of the clock add up."""
    waited = Patience(0.5)
    assert not waited.is_over(8.0)
    clock.sleep(7.0)  # stamps advance: the clock does not count
    assert not waited.is_over(8.25)
    clock.sleep(0.125)
    assert not waited.is_over(8.25)
    assert waited.cause == ""
    assert not waited.is_over(8.375)  # 0.375 s of stamps and 0.125 s of the clock
    assert waited.is_over(8.3765)
    assert waited.cause == ""


def test_stamps_are_blamed_if_they_paused_for_longer(clock):
    """The pause must exceed the advance; an equal pause does not."""
    waited = Patience(9.0)
    waited.is_over(1.0)
    waited.is_over(1.25)
    clock.sleep(0.25)
    waited.is_over(1.25)
    assert waited.cause == ""
    clock.sleep(0.25)
    waited.is_over(1.0)
    assert waited.cause != ""
