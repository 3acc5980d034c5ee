"""How long after its exposure a picture arrives: the lag between the arms' motion and that in the picture."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from basecal.acquisition.pictures.arm_motion import Span
from basecal.geometry import Array

_LARGEST_S = 6.0
_STEP_S = 0.005
_LEAST_PICTURES = 3  # that have to show the motion
_LEAST_OVERLAP = 0.5  # of the arms' motion and that in the picture, over both: below, something else moved


@dataclass(frozen=True)
class Latency:
    """From exposure to arrival: between `low_s` and `high_s` [s]."""

    low_s: float
    high_s: float

    def __str__(self) -> str:
        return f"{(self.low_s + self.high_s) / 2:.2f} +- {(self.high_s - self.low_s) / 2:.2f} s"


def latency_of(spans: Sequence[Span], arrived_s: Array, moves: NDArray[np.bool_]) -> Latency | None:
    """The latency at which motions of arms explain those in pictures; None if they do not.

    Lags are tried, and those at which one picture more or less would agree as well as at the best are possible. A slow
    begin that only the joints show, or a swing at the end that only the picture shows, makes it larger, never smaller.

    Args:
        spans: When arms moved.
        arrived_s: (n,) when pictures arrived, from before the first motion on.
        moves: (n,) whether each differs from the one before.
    """
    if not spans or moves.sum() < _LEAST_PICTURES:
        return None
    moves = moves.copy()
    moves[1:-1] |= moves[:-2] & moves[2:]  # cameras give a picture twice
    lags = np.arange(0.0, _LARGEST_S, _STEP_S)
    exposed = arrived_s[:, None] - lags
    expected = np.zeros(exposed.shape, dtype=bool)
    for begin, end in spans:
        expected |= (exposed >= begin) & (exposed <= end)
    both = (expected & moves[:, None]).sum(0)
    either = np.maximum((expected | moves[:, None]).sum(0), 1)
    overlap = both / either
    if overlap.max() < _LEAST_OVERLAP:
        return None
    possible = lags[overlap >= overlap.max() - 1 / either[overlap.argmax()]]
    return Latency(float(possible[0]), float(possible[-1]))
