"""Whether states come, and often enough."""

from __future__ import annotations

import time

import pytest

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
