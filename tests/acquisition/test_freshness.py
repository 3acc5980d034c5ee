"""Whether states come, and often enough."""

from __future__ import annotations

import pytest

from basecal.acquisition.freshness import Stale, Waits, next_of
from basecal.errors import DriverError


def test_what_comes_is_given():
    """It is asked again until it gives something."""
    given = iter([None, None, 3])
    assert next_of(lambda: next(given), 1.0) == 3


def test_what_does_not_come_is_told():
    """After the time is up it is stale."""
    with pytest.raises(Stale):
        next_of(lambda: None, 0.02)


def test_too_few_states_are_told_by_their_number():
    """Twelve waits of a quarter of a second are four states in a second; what was before a lost connection is none."""
    waits = Waits("eye")
    for _ in range(11):
        waits.add(0.25)
    waits.forget()
    for _ in range(11):
        waits.add(0.25)
    with pytest.raises(DriverError, match="eye: only 4 states in a second, at least 10 are needed"):
        waits.add(0.25)


def test_ten_in_a_second_are_enough():
    """And whoever asks seldom waits less, and is not told."""
    waits = Waits("eye")
    for wait_s in 30 * [0.0999]:
        waits.add(wait_s)
