"""Latency of images from exposure to arrival, estimated from the motion of the arms and the motion in the images."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from basecal.acquisition.driver import Reading
from basecal.cell import RobotState
from basecal.geometry import Array

_LEAST_MOTION_RAD_M = 2e-3  # of any joint: visible in images, and larger than encoder noise
_PAUSE_S = 0.3  # shorter pauses are part of one motion
_LAGS_S = np.arange(0.0, 6.0, 0.005)
_LEAST_IMAGES = 3  # images that show the motion
_STILL_IMAGES = 2  # still images after the motion
_LEAST_OVERLAP = 0.5  # intersection over union of both motions, below which something else moved
_CHANCE_FACTOR = 1.01  # images that may disagree by chance: one


class ArmMotion:
    """The motions of all arms of a rig; one thread adds states, the threads of cameras read.

    Attributes:
        spans: Start and end of each motion since the last sample [s], by `time.monotonic()`.
        show: Receives each state, with the robot's name.
    """

    def __init__(self) -> None:
        self.spans: tuple[tuple[float, float], ...] = ()
        self.show: Callable[[str, RobotState], None] = lambda robot, state: None
        self._last_values: dict[str, Array] = {}

    def note(self, name: str, reading: Reading) -> None:
        """Add the newest state of a robot."""
        self.show(name, reading.state)
        now_s, values = time.monotonic(), reading.state.vector
        if np.abs(values - self._last_values.setdefault(name, values)).max() <= _LEAST_MOTION_RAD_M:
            return
        self._last_values[name] = values
        goes_on = bool(self.spans) and now_s - self.spans[-1][1] < _PAUSE_S
        begin_s = self.spans[-1][0] if goes_on else now_s
        self.spans = (*(self.spans[:-1] if goes_on else self.spans), (begin_s, now_s))

    def forget(self) -> None:
        """Discard all motions, after a sample was taken."""
        self.spans = ()


@dataclass(frozen=True)
class Latency:
    """Latency from exposure to arrival: between `low_s` and `high_s` [s]."""

    low_s: float
    high_s: float

    def __str__(self) -> str:
        return f"{(self.low_s + self.high_s) / 2:.2f} +- {(self.high_s - self.low_s) / 2:.2f} s"


def estimate_latency(spans: Array, arrivals: Array) -> Latency | None:
    """Estimate the latency at which arm motions explain the motions in images.

    The range contains all tested lags whose agreement is at most one image below the best. A slow start that only the
    joints show, or a final swing that only the image shows, increases the latency and never decreases it.

    Args:
        spans: (m, 2) start and end of each arm motion [s].
        arrivals: (n, 2) arrival time of each image [s] since the first motion; 1 if the image differs from the
            previous one, else 0.

    Returns:
        None if arm motions do not explain those in images, or have not ended.
    """
    moves = arrivals[:, 1] > 0
    if moves.sum() < _LEAST_IMAGES or moves[-_STILL_IMAGES:].any():
        return None
    moves[1:-1] |= moves[:-2] & moves[2:]  # some cameras repeat an image
    exposed = arrivals[:, :1, None] - _LAGS_S[:, None]
    expected = ((exposed >= spans[:, 0]) & (exposed <= spans[:, 1])).any(-1)
    either = np.maximum((expected | moves[:, None]).sum(0), 1)
    overlap = (expected & moves[:, None]).sum(0) / either
    if overlap.max() < _LEAST_OVERLAP:
        return None
    possible = _LAGS_S[overlap >= overlap.max() - _CHANCE_FACTOR / either[overlap.argmax()]]
    return Latency(float(possible[0]), float(possible[-1]))
