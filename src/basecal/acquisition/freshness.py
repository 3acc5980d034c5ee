"""Checks of a stream of states: timestamps that advance, and a sufficient rate."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from typing import TypeVar

from basecal.errors import DriverError

LEAST_HZ = 10.0
"""Lowest accepted rate of states [Hz]: stillness is judged from twelve states."""

STALE_S = 1.0
"""Time without a new state after which the connection is re-established [s]."""

_POLL_S = 5e-4  # polling period of data received by another thread: a quarter of the shortest state period, 2 ms
_SUSTAINED_S = 5.0  # time of waiting over which the rate is measured
_RATE_STATES = round(_SUSTAINED_S * LEAST_HZ)

Item = TypeVar("Item")


class Stale(Exception):
    """No new data before the timeout; the caller decides what to do."""


def wait_for_newer(read_newer: Callable[[], Item | None], wait_s: float = STALE_S) -> Item:
    """Poll `read_newer` until it returns a result that is not None.

    Raises:
        Stale: if there is none before the timeout [s].
    """
    deadline_s = time.monotonic() + wait_s
    while (item := read_newer()) is None:
        if time.monotonic() > deadline_s:
            raise Stale
        time.sleep(_POLL_S)
    return item


class Waits:
    """Monitor of the waiting times for states: detects a rate that stays too low, but tolerates one outage.

    Only the time spent waiting counts, so that infrequent requests never fail.
    """

    def __init__(self, name: str) -> None:
        self._name = name
        self._waits_s: deque[float] = deque(maxlen=_RATE_STATES + 1)

    def forget(self) -> None:
        """Discard the waiting times, after a lost connection."""
        self._waits_s.clear()

    def add(self, wait_s: float) -> None:
        """Add the waiting time of a state [s].

        Raises:
            DriverError: if the rate was below 10 Hz for five seconds, not counting the longest wait.
        """
        self._waits_s.append(wait_s)
        waited_s = sum(self._waits_s) - max(self._waits_s)
        if waited_s > _SUSTAINED_S:
            rate_hz = (len(self._waits_s) - 1) / waited_s
            raise DriverError(
                f"{self._name}: only {rate_hz:.2g} states in a second came for {waited_s:.1f} s, at least {LEAST_HZ:g} "
                f"are needed. Raise the rate at which they are sent, or look for what slows the network"
            )


class Patience:
    """Timeout by the timestamps of states, or by this machine's clock while the timestamps do not advance."""

    def __init__(self, patience_s: float) -> None:
        self._patience_s, self._advanced_s, self._frozen_s = patience_s, 0.0, 0.0
        self._stamp_s, self._read_s = float("nan"), 0.0

    def is_over(self, stamp_s: float) -> bool:
        """Add the timestamp of a state [s]; whether more than the timeout has passed since the first state."""
        previous_stamp_s, previous_read_s = self._stamp_s, self._read_s
        self._stamp_s, self._read_s = stamp_s, time.monotonic()
        if stamp_s > previous_stamp_s:
            self._advanced_s += stamp_s - previous_stamp_s
        elif stamp_s <= previous_stamp_s:
            self._frozen_s += self._read_s - previous_read_s
        return self._advanced_s + self._frozen_s > self._patience_s

    @property
    def cause(self) -> str:
        """Note for a message that the timestamps did not advance most of the time; else empty."""
        return " (the stamps of its states do not advance)" if self._frozen_s > self._advanced_s else ""
