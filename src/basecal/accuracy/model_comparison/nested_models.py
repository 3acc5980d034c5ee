"""Effects of which the model in use is the special case of size zero: score tests, and ratios of likelihoods.

Where models are not nested, or priors are known, ratios of likelihoods are e-values. By Markov's inequality, the chance
that one exceeds c is at most 1 / c if the model in use is true.
Source: Rao 1948, Wilks 1938. Fisher 1925 treats estimated noise, Benjamini & Hochberg 1995 many tests. Sellke, Bayarri
& Berger 2001 treat chances as evidence; Vovk and Wang 2021, arXiv:1912.06116, e-values.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum

import numpy as np
from scipy.special import chdtrc, fdtrc, gammaln

from basecal.geometry import Array, BoolArray
from basecal.numerics.spectral import scaled_spectrum

SINGLE_LEVEL = 1e-4
"""Chance of a finding that one test makes alone: ten such tests raise one false alarm in a thousand calibrations.

`benchmarks.false_alarms` measures it.
"""

CONFIRMED = 1e-3
"""Likewise of a finding that held-out data or a next sample confirm too: they do not confirm most that chance makes."""

MOVED = 5e-3
"""Chance of an alarm of one check, or of one pair of runs, if nothing moved: about once in a year of working days.

`benchmarks.verify` measures it.
"""

DISAGREES = 0.01
"""Chance of new samples below which a cause is looked for; `benchmarks.running_check` measures the alarms."""

FALSE_DISCOVERIES = 0.0025
"""Share of the effects found in a calibration that are not there.

A quarter of the false alarms that all rules may raise in a hundred calibrations; `benchmarks.false_alarms` measures it.
"""

SUSPECTED = 0.02
"""Chance of a score below which an effect is solved for; `benchmarks.small_faults` measures what that misses."""

_EQUAL = 6.0  # twice the log ratio of likelihoods: what is e^3 times less likely than the best is told from it
_VERY_STRONG = 10.0  # of twice the log ratio of evidences (Kass & Raftery 1995)
_ROOM_M = 1.0  # [m] edge of the cube in which copies may be; assumed
LEAST_CHANCE = 1e-300
"""A smaller chance is hardly a number any more: doubles end at 2e-308."""


def compare_nested_models(
    gain: float, freedoms: float, level: float = SINGLE_LEVEL, noise_freedoms: float = np.inf
) -> Comparison:
    """A wider model by its gain.

    Args:
        gain: Twice the log ratio of likelihoods, or the score: chi-square if the model in use is true.
        freedoms: Of the chi-square.
        level: Chance below which the wider model is taken.
        noise_freedoms: By which the noise is known; infinite if it is stated.
    """
    return decide(gain, log_chance(gain, freedoms, noise_freedoms), level)


def log_chance(statistic: float, freedoms: float, noise_freedoms: float = np.inf) -> float:
    """Logarithm of the chance of a chi-square so large or larger; 0 without freedoms or a gain.

    Of estimated noise it is Fisher's distribution, as far as that is a number.
    """
    if freedoms < 1 or statistic <= 0:
        return 0.0
    known = np.isinf(noise_freedoms)
    chance = chdtrc(freedoms, statistic) if known else fdtrc(freedoms, noise_freedoms, statistic / freedoms)
    if chance > LEAST_CHANCE:
        return float(np.log(chance))
    # The first term of the tail far out: Abramowitz & Stegun 6.5.32.
    return float(-0.5 * statistic + (0.5 * freedoms - 1) * np.log(0.5 * statistic) - gammaln(0.5 * freedoms))


def compare_evidence(gain: float) -> Comparison:
    """A wider model by its gain in evidence: twice the log of the ratio, which is an e-value."""
    decision = Decision.TAKE if gain > _VERY_STRONG else Decision.KEEP
    return Comparison(gain, -0.5 * gain, decision)


def compare_likelihoods(log_ratios: Array) -> Comparison:
    """A rival by the log ratios of its likelihood over that of the model in use, at each value of an open number.

    Neither model is simpler: the rival is taken where the other would have to be suspected.

    Args:
        log_ratios: (n,) for each value, all equally probable.
    """
    log_mean = float(np.logaddexp.reduce(log_ratios) - np.log(len(log_ratios)))
    return decide(2 * float(np.max(log_ratios)), -log_mean, SUSPECTED)


def compare_split(ratio: float, count: int, width: int) -> Comparison:
    """Two means in place of one, of which nobody says which items have which, by what they leave of the squares.

    Every way to split the items is a test. The chance is at most that of one split times their number, by Bonferroni.

    Args:
        ratio: Sum of squares about the two means over that about one.
        count: Items.
        width: Numbers of each.
    """
    left = width * (count - 2)
    gain = (1 / max(ratio, LEAST_CHANCE) - 1) * left
    return decide(gain, log_chance(gain, width, left) + (count - 1) * np.log(2), SINGLE_LEVEL)


def compare_places(offset: Array, covariance: Array) -> Comparison:
    """Whether two independent estimates are of one place; taken if no deceived one would be so near by chance.

    One deceived by a copy of an object may be anywhere in a room. The ratio of evidences is the density of what is
    between the two over that of any place there. Directions of which they know no more than the room say nothing.

    Args:
        offset: (3,) from one to the other [m].
        covariance: (3, 3) of it [m^2].
    """
    of = scaled_spectrum(covariance, 1.0)
    width = _ROOM_M / np.sqrt(2 * np.pi * of.values)
    gain = np.sum(2 * np.log(np.maximum(width, 1.0))) - np.sum((offset @ of.vectors) ** 2 / of.values)
    return compare_evidence(float(gain))


def largest_share(log_chance: float) -> float:
    """How probable a wider model of such a chance is at most, if it is true as often as not.

    Source: docs/mathematics.md (11.7).
    """
    log_chance = min(log_chance, -1.0)
    return float(1 / (1 - log_chance * np.exp(1 + log_chance)))


def discoveries(log_chances: Sequence[float], tests: int, share: float = FALSE_DISCOVERIES) -> BoolArray:
    """Which of the effects with these chances are discovered, (n,), of a family of so many tests.

    The share of false discoveries is `share` at most, on average (Benjamini & Hochberg 1995). If there is no effect at
    all, it is the share of families in which one is found.

    Args:
        log_chances: (n,) of effects that may be there; the others of the family count as not discovered.
        tests: How many the family has.
        share: Of discoveries that may be false.
    """
    order = np.argsort(log_chances)
    limits = np.log(share * np.arange(1, len(order) + 1) / max(tests, 1))
    below = np.flatnonzero(np.asarray(log_chances)[order] < limits)
    found = np.zeros(len(order), dtype=bool)
    found[order[: below[-1] + 1 if len(below) else 0]] = True
    return found


def equally_likely(costs: Sequence[float]) -> list[int]:
    """Which explanations the data do not distinguish from the best one, itself among them.

    Args:
        costs: (n,) of each: minus twice its log likelihood, and what its freedoms take away by chance.
    """
    best = min(costs, default=0.0)
    return [k for k, cost in enumerate(costs) if cost < best + _EQUAL]


class Decision(Enum):
    """Which of two models to believe."""

    KEEP = "the model in use"
    UNDECIDED = "either"
    TAKE = "the rival"


@dataclass(frozen=True)
class Comparison:
    """A rival model beside the one in use.

    Attributes:
        gain: By how much it explains the data better: twice the log ratio of likelihoods, or of evidences.
        log_chance: Logarithm of the chance of such a gain if the model in use is true: a p-value, or the inverse of an
            e-value.
        decision: Which of the two to believe.
    """

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


def decide(gain: float, log_chance: float, level: float, doubtful_level: float = 0.0) -> Comparison:
    """The rival is taken below one chance, and undecided below a larger one.

    Args:
        gain: See `Comparison`.
        log_chance: Likewise.
        level: Chance below which it is taken.
        doubtful_level: Chance below which neither is kept nor taken.
    """
    below = Decision.UNDECIDED if np.exp(log_chance) < doubtful_level else Decision.KEEP
    return Comparison(gain, log_chance, Decision.TAKE if log_chance < np.log(level) else below)
