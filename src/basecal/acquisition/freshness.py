"""Whether states come as they should: with stamps that go on, and often enough to judge stillness."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from typing import TypeVar

from basecal.errors import DriverError

LEAST_HZ = 10.0
"""Fewest states in a second: stillness is judged from twelve of them."""

STALE_S = 1.0
"""Without a new state for so long, the connection is made anew."""

_POLL_S = 5e-4  # between looks at what a client's own thread receives: a quarter of the shortest period, 2 ms
_SUSTAINED_S = 5.0  # of waiting, over which the rate is measured
_RATE_STATES = round(_SUSTAINED_S * LEAST_HZ)

Given = TypeVar("Given")


class Stale(Exception):
    """The source gave nothing new; the caller says what to do about it."""


def wait_for_newer(read_newer: Callable[[], Given | None], wait_s: float = STALE_S) -> Given:
    """The first result of `read_newer` that is not None.

    Raises:
        Stale: if it gives nothing for so long [s].
    """
    until = time.monotonic() + wait_s
    while (given := read_newer()) is None:
        if time.monotonic() > until:
            raise Stale
        time.sleep(_POLL_S)
    return given


class Waits:
    """How long states are waited for: one outage is forgiven, a rate that stays too low is not.

    Rare requests wait less, and never fail because states are too few.
    """

    def __init__(self, name: str) -> None:
        self._name = name
        self._waits_s: deque[float] = deque(maxlen=_RATE_STATES + 1)

    def forget(self) -> None:
        """Begin again, after a connection that was lost."""
        self._waits_s.clear()

    def add(self, wait_s: float) -> None:
        """Count a state.

        Raises:
            DriverError: if states came less often than ten times a second for five seconds, not counting one outage.
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
    """Time that has passed by the stamps of states, or by this machine's clock while the stamps stand still."""

    def __init__(self, patience_s: float) -> None:
        self._patience_s, self._passed_s, self._standing_s = patience_s, 0.0, 0.0
        self._stamp_s, self._at_s = float("nan"), 0.0

    def is_over(self, stamp_s: float) -> bool:
        """Count a state, and give whether more than the patience has passed since the first one."""
        before_s, before_at_s = self._stamp_s, self._at_s
        self._stamp_s, self._at_s = stamp_s, time.monotonic()
        if stamp_s > before_s:
            self._passed_s += stamp_s - before_s
        elif stamp_s <= before_s:
            self._standing_s += self._at_s - before_at_s
        return self._passed_s + self._standing_s > self._patience_s

    @property
    def cause(self) -> str:
        """Words about a clock that stood still most of the time; empty if it went on."""
        return " (the stamps of its states stand still)" if self._standing_s > self._passed_s else ""
