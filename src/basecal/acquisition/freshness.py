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
_STATES = 12  # over which the rate is measured

Given = TypeVar("Given")


class Stale(Exception):
    """Nothing new came; the caller says what to do about it."""


def next_of(newer: Callable[[], Given | None], wait_s: float = STALE_S) -> Given:
    """What `newer` gives, once it gives something.

    Raises:
        Stale: if it gives nothing for so long [s].
    """
    until = time.monotonic() + wait_s
    while (given := newer()) is None:
        if time.monotonic() > until:
            raise Stale
        time.sleep(_POLL_S)
    return given


class Waits:
    """How long states are waited for; whoever asks seldom waits less, and is never told that they are too few."""

    def __init__(self, name: str) -> None:
        self._name = name
        self._waits_s: deque[float] = deque(maxlen=_STATES)

    def forget(self) -> None:
        """Begin again, after a connection that was lost."""
        self._waits_s.clear()

    def add(self, wait_s: float) -> None:
        """Count a state.

        Raises:
            DriverError: if the last twelve came less often than ten times a second.
        """
        self._waits_s.append(wait_s)
        total_s = sum(self._waits_s)
        if len(self._waits_s) == _STATES and total_s > _STATES / LEAST_HZ:
            raise DriverError(
                f"{self._name}: only {_STATES / total_s:.2g} states in a second, at least {LEAST_HZ:g} are needed: "
                f"raise the rate at which they are sent, or look for what slows the network"
            )
