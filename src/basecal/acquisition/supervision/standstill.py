"""Times for which a process did not run: it was stopped, its container was frozen, or a call blocked it."""

from __future__ import annotations

import time


class Standstill:
    """Monitor of a loop with a short period: a process that did not run cannot judge others by their silence."""

    def __init__(self) -> None:
        self._cycle_s = time.monotonic()

    @property
    def duration_s(self) -> float:
        """Time since the last cycle [s]."""
        return time.monotonic() - self._cycle_s

    def end_cycle(self) -> None:
        """Note that the loop runs."""
        self._cycle_s = time.monotonic()


def standstill_reason(process: str, duration_s: float) -> str:
    """The reason of a stop after a process did not run for a time [s]."""
    return f"{process} did not run for {duration_s:.1f} s"
