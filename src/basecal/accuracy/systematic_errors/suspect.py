"""An error whose score chance hardly makes, before it is solved for."""

from __future__ import annotations

from dataclasses import dataclass

from basecal.accuracy.systematic_errors.place_scatter import PlaceScatter
from basecal.effects.faces.candidates import Candidates
from basecal.geometry import Array

COST = 0.5
"""Among errors, one of many costs half the logarithm of their number; `benchmarks.false_alarms` judges it."""


@dataclass(frozen=True, eq=False)
class Suspect:
    """An error whose score chance hardly makes.

    Attributes:
        effect: Name of the effect that it is of.
        candidate: It alone.
        size: (q,) to first order.
        freedoms: How many of its sizes the data show.
        statistic: Its chi-square.
        log_chance: Logarithm of the chance that any of its code has such a score.
        screened: The same, or less where stops share no errors, whose sigmas may hold the error itself.
        several: Logarithm of how many these are.
        family: How many codes were tested.
        scatter: What it has to exceed; None if that is noise alone.
    """

    effect: str
    candidate: Candidates
    size: Array
    freedoms: int
    statistic: float
    log_chance: float
    screened: float
    several: float
    family: int = 1
    scatter: PlaceScatter | None = None

    @property
    def rank(self) -> float:
        """Logarithm of its chance among errors of all codes, where no random effect can hold one."""
        return self.screened + COST * self.several

    def log_chance_beside_places(self, gain: float, chance: float) -> float:
        """Logarithm of the chance of its score, or of a larger gain, beside what differs by place.

        Args:
            gain: Of minus twice the log likelihood.
            chance: The logarithm of the chance of both beside noise.
        """
        if self.scatter is None:
            return chance
        return self.scatter.log_chance(max(gain, self.statistic), self.freedoms) + self.several
