"""How long a calibration takes still, predicted from the stages it has gone through."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from basecal.estimation.stages import StageName

# How long each stage takes of 100 that the solution and all its tests take, in their order; a mean over cells of 30 to
# 300 samples, whose stages differ by a factor of three from it. A stage that is not listed counts as nothing.
_SHARES: Mapping[StageName, int] = {
    "problem": 1,
    "start": 4,
    "descent": 1,
    "observability": 1,
    "noise": 32,
    "conventions": 40,
    "outliers": 4,
    "stated sigmas": 1,
    "robot model": 3,
    "systematic errors": 3,
    "certificate": 1,
    "cross-validation": 7,
    "findings": 2,
    "report": 35,
}
_SOONEST_S = 1.0  # before it, and less than it, nothing is said of the time


class TimeLeft:
    """The current stage and the time left, as a line to show.

    Attributes:
        message: What all of it is called.
    """

    def __init__(self, message: str, clock: Callable[[], float] = time.monotonic) -> None:
        self.message = message
        self._clock = clock
        self._began = self._stage_began = clock()
        self._stage = ""
        self._seen: set[str] = set()

    def enter(self, stage: str) -> None:
        """Note that a stage begins, and the one before it has ended; or, after a comma, how much of it is done."""
        before, _, _ = self._stage.partition(",")
        if stage.partition(",")[0] == before:
            self._stage = stage
            return
        if before:
            self._seen.add(before)
        self._stage, self._stage_began = stage, self._clock()

    def seconds(self) -> float | None:
        """How long all stages take still [s]; None if too little is known."""
        done = sum(share for stage, share in _SHARES.items() if stage in self._seen)
        before = self._stage_began - self._began
        if not done or before < _SOONEST_S:
            return None
        return max(before * (sum(_SHARES.values()) - done) / done - (self._clock() - self._stage_began), 0.0)

    def __str__(self) -> str:
        left = self.seconds()
        stage = f": {self._stage}" if self._stage else ""
        return f"{self.message}{stage}" + (f", about {left:.0f} s left" if left and left >= _SOONEST_S else "")

    def __rich__(self) -> str:
        return str(self)
