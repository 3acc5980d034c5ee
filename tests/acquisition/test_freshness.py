"""Whether states come, and often enough."""

from __future__ import annotations

import time

import pytest

from basecal.acquisition import freshness
from basecal.acquisition.freshness import Patience, Stale, Waits, wait_for_newer
from basecal.errors import DriverError


def test_what_comes_is_given():
    """It is asked again until it gives something."""
    given = iter([None, None, 3])
    assert wait_for_newer(lambda: next(given), 1.0) == 3


def test_what_does_not_come_is_told():
    """After the time is up it is stale."""
    with pytest.raises(Stale):
        wait_for_newer(lambda: None, 0.02)


def test_a_rate_that_stays_too_low_is_refused_by_its_number():
    """Four states in a second are refused after five seconds; the message states the rate and the rate needed."""
    waits = Waits("eye")
    for _ in range(21):
        waits.add(0.25)
    with pytest.raises(DriverError, match=r"eye: only 4 states in a second came for 5\.2 s, at least 10 are needed"):
        waits.add(0.25)


@pytest.mark.parametrize("outage_s", [1.4, 9.0])
def test_one_outage_is_forgiven_whatever_its_length(outage_s):
    """An outage counts as one wait that is left out, and so does a short dip of the rate."""
    waits = Waits("eye")
    for wait_s in [*20 * [0.008], outage_s, *20 * [0.008], *12 * [1.4 / 12], *20 * [0.008]]:
        waits.add(wait_s)


def test_states_that_only_come_after_outages_are_refused():
    """Gaps of two seconds, one after another, are a rate that is too low and no outage."""
    waits = Waits("eye")
    with pytest.raises(DriverError, match=r"eye: only 0\.5 states in a second"):
        [waits.add(2.0) for _ in range(6)]


def test_ten_in_a_second_are_enough():
    """And whoever asks seldom waits less, and is not told."""
    waits = Waits("eye")
    for wait_s in 300 * [0.0999]:
        waits.add(wait_s)


def test_patience_goes_by_the_stamps():
    """Half a second of stamps passes in no time of this machine, and the clock is not blamed."""
    waited = Patience(0.5)
    assert not any(waited.is_over(stamp_s) for stamp_s in (7.0, 7.2, 7.4))
    assert waited.is_over(7.6)
    assert waited.cause == ""


@pytest.mark.parametrize("step_s", [0.0, -1.0])
def test_patience_ends_though_stamps_stand_still(step_s):
    """With stamps that stand still or go back, time passes by this machine's clock, and the cause is named."""
    waited, stamp_s, began_s = Patience(0.05), 7.0, time.monotonic()
    while not waited.is_over(stamp_s):
        stamp_s += step_s
        assert time.monotonic() - began_s < 10
    assert time.monotonic() - began_s >= 0.05
    assert waited.cause == " (the stamps of its states do not advance)"


class Clock:
    """A clock that sleeping moves on."""

    def __init__(self):
        self.now_s, self.slept = 100.0, 0

    def monotonic(self):
        return self.now_s

    def sleep(self, time_s):
        self.now_s += time_s
        self.slept += 1


@pytest.fixture
def clock(monkeypatch):
    """The clock of the module."""
    made = Clock()
    monkeypatch.setattr(freshness, "time", made)
    return made


def test_what_is_there_is_given_at_once(clock):
    """Without a pause, zero as well as anything else; what is there when the time is up is still given."""
    assert wait_for_newer(lambda: 0, 0.0) == 0
    assert clock.slept == 0
    given = iter([None, "late"])
    assert wait_for_newer(lambda: next(given), 0.0) == "late"


@pytest.mark.parametrize("wait_s", [0.25, None])
def test_what_is_awaited_is_polled_until_the_time_is_up(clock, wait_s):
    """More often than any robot sends, for a second if nothing else is said."""
    with pytest.raises(Stale):
        wait_for_newer(lambda: None, **({} if wait_s is None else {"wait_s": wait_s}))
    assert clock.now_s - 100.0 == pytest.approx(wait_s or 1.0, abs=2e-3)
    assert clock.slept >= 500 * (wait_s or 1.0)


@pytest.mark.parametrize(("wait_s", "is_enough"), [(0.099, True), (0.1015, False)])
def test_the_rate_is_that_of_five_seconds(wait_s, is_enough):
    """Just above and just below ten in a second; what was before five seconds does not count."""
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
    """A rate that was too low for four seconds, before and after."""
    waits = Waits("eye")
    for _ in range(2):
        for _ in range(16):
            waits.add(0.25)
        waits.forget()
        waits.forget()


def test_patience_is_over_when_more_has_passed(clock):
    """As much as the limit is within it; stamps and the clock count together, whichever moved."""
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


def test_stamps_are_blamed_if_they_stood_for_longer(clock):
    """Longer than they advanced; as long is not longer."""
    waited = Patience(9.0)
    waited.is_over(1.0)
    waited.is_over(1.25)
    clock.sleep(0.25)
    waited.is_over(1.25)
    assert waited.cause == ""
    clock.sleep(0.25)
    waited.is_over(1.0)
    assert waited.cause != ""
