"""How long after its exposure an image arrives: the lag between the arms' motion and that in the image."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from basecal.acquisition.driver import Reading
from basecal.cell import RobotState
from basecal.geometry import Array

_LEAST_MOTION = 2e-3  # [rad, m] of any joint: an image shows it, and noise of encoders is smaller
_PAUSE_S = 0.3  # shorter pauses are part of one motion
_LAGS_S = np.arange(0.0, 6.0, 0.005)
_LEAST_IMAGES = 3  # that have to show the motion
_STILL_IMAGES = 2  # after it
_LEAST_OVERLAP = 0.5  # of the arms' motion and that in the image, over both: below, something else moved
_CHANCE_FACTOR = 1.01  # images that may disagree by chance: one


class ArmMotion:
    """The motions of all arms of a rig; one thread notes states, threads of cameras read.

    Attributes:
        spans: Begin and end of each motion since the last sample [s], by `time.monotonic()`.
        show: Receives each state, with the robot's name.
    """

    def __init__(self) -> None:
        self.spans: tuple[tuple[float, float], ...] = ()
        self.show: Callable[[str, RobotState], None] = lambda robot, state: None
        self._at: dict[str, Array] = {}

    def note(self, name: str, reading: Reading) -> None:
        """Take account of a state that a robot, by its name, gave just now."""
        self.show(name, reading.state)
        now_s, here = time.monotonic(), reading.state.vector
        if np.abs(here - self._at.setdefault(name, here)).max() <= _LEAST_MOTION:
            return
        self._at[name] = here
        goes_on = bool(self.spans) and now_s - self.spans[-1][1] < _PAUSE_S
        begin_s = self.spans[-1][0] if goes_on else now_s
        self.spans = (*(self.spans[:-1] if goes_on else self.spans), (begin_s, now_s))

    def forget(self) -> None:
        """Begin anew: the motions until now have led to a sample."""
        self.spans = ()


@dataclass(frozen=True)
class Latency:
    """Latency from exposure to arrival: between `low_s` and `high_s` [s]."""

    low_s: float
    high_s: float

    def __str__(self) -> str:
        return f"{(self.low_s + self.high_s) / 2:.2f} +- {(self.high_s - self.low_s) / 2:.2f} s"


def estimate_latency(spans: Array, arrivals: Array) -> Latency | None:
    """The latency at which motions of arms explain those in images; None if they do not, or still go on.

    Lags are tried, and those at which one image more or less would agree as well as at the best are possible. A slow
    begin that only the joints show, or a swing at the end that only the image shows, makes it larger, never smaller.

    Args:
        spans: (m, 2) when arms moved.
        arrivals: (n, 2) when images arrived since the first motion began, and 1 for each that differs from the one
            before, 0 for others.
    """
    moves = arrivals[:, 1] > 0
    if moves.sum() < _LEAST_IMAGES or moves[-_STILL_IMAGES:].any():
        return None
    moves[1:-1] |= moves[:-2] & moves[2:]  # some cameras give an image twice
    exposed = arrivals[:, :1, None] - _LAGS_S[:, None]
    expected = ((exposed >= spans[:, 0]) & (exposed <= spans[:, 1])).any(-1)
    either = np.maximum((expected | moves[:, None]).sum(0), 1)
    overlap = (expected & moves[:, None]).sum(0) / either
    if overlap.max() < _LEAST_OVERLAP:
        return None
    possible = _LAGS_S[overlap >= overlap.max() - _CHANCE_FACTOR / either[overlap.argmax()]]
    return Latency(float(possible[0]), float(possible[-1]))
