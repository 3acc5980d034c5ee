"""When arms moved, by the states they gave."""

from __future__ import annotations

import time

import numpy as np

from basecal.acquisition.driver import Reading
from basecal.acquisition.stillness import vector_of
from basecal.geometry import Array

Span = tuple[float, float]
"""Begin and end of a motion [s], by `time.monotonic()` of this machine."""

_MOVES = 2e-3  # [rad, m] of any joint: a picture shows it, and noise of encoders is smaller
_PAUSE_S = 0.3  # shorter pauses are part of one motion


class ArmMotion:
    """The motions of all arms of a rig; one thread notes states, threads of cameras read."""

    def __init__(self) -> None:
        self.spans: tuple[Span, ...] = ()
        self._at: dict[str, Array] = {}

    def note(self, name: str, reading: Reading) -> None:
        """Take account of a state that came just now.

        Args:
            name: Of the robot.
            reading: What it gave.
        """
        now_s, here = time.monotonic(), vector_of(reading.state)
        before = self._at.setdefault(name, here)
        if np.abs(here - before).max() <= _MOVES:
            return
        self._at[name] = here
        if self.spans and now_s - self.spans[-1][1] < _PAUSE_S:
            self.spans = (*self.spans[:-1], (self.spans[-1][0], now_s))
        else:
            self.spans = (*self.spans, (now_s, now_s))

    def forget(self) -> None:
        """Begin anew: the motions until now have led to a sample."""
        self.spans = ()
