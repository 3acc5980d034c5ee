"""A rival model beside the one in use, and which of the two to believe."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np


class Decision(Enum):
    """Which of two models to believe."""

    KEEP = "the model in use"
    UNDECIDED = "either"
    TAKE = "the rival"


@dataclass(frozen=True)
class Comparison:
    """A rival model beside the one in use.

    Attributes:
        rival: Its name.
        gain: By how much it explains the data better: twice the log ratio of likelihoods, or of evidences.
        log_chance: Logarithm of the chance of such a gain if the model in use is true: a p-value, or the inverse of an
            e-value.
        decision: Which of the two to believe.
    """

    rival: str
    gain: float
    log_chance: float
    decision: Decision

    @property
    def chance(self) -> float:
        """The chance of such a gain if the model in use is true."""
        return float(np.exp(min(self.log_chance, 0.0)))

    @property
    def is_taken(self) -> bool:
        """Whether to believe the rival."""
        return self.decision is Decision.TAKE


def decide(rival: str, gain: float, log_chance: float, level: float, doubtful_level: float = 0.0) -> Comparison:
    """The rival is taken below one chance, and undecided below a larger one.

    Args:
        rival: Its name.
        gain: See `Comparison`.
        log_chance: Likewise.
        level: Chance below which it is taken.
        doubtful_level: Chance below which neither is kept nor taken.
    """
    chance = np.exp(min(log_chance, 0.0))
    below = Decision.UNDECIDED if chance < doubtful_level else Decision.KEEP
    return Comparison(rival, gain, log_chance, Decision.TAKE if log_chance < np.log(level) else below)
