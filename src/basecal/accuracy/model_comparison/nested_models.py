"""Tests of effects that are zero in the model in use: score tests and likelihood ratios.

If models are not nested, or priors are known, likelihood ratios are e-values. By Markov's inequality, the probability
that an e-value exceeds c is at most 1 / c if the model in use is true.
Source: Rao 1948, Wilks 1938. Fisher 1925 treats estimated noise, Benjamini & Hochberg 1995 many tests. Sellke, Bayarri
& Berger 2001 treat p-values as evidence; Vovk and Wang 2021, arXiv:1912.06116, e-values.
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
"""Significance level of a finding from a single test: ten such tests raise one false alarm in 1000 calibrations.

`benchmarks.false_alarms` measures it.
"""

CONFIRMED_LEVEL = 1e-3
"""Significance level of a finding that held-out data or a further sample must confirm, too."""

MOVED_LEVEL = 5e-3
"""False alarm rate of one check, or of one pair of runs, if nothing moved: about once in a year of working days.

`benchmarks.verify` measures it.
"""

DISAGREEMENT_LEVEL = 0.01
"""p-value of new samples below which a cause is searched; `benchmarks.running_check` measures the alarms."""

FALSE_DISCOVERY_RATE = 0.0025
"""Accepted rate of false discoveries among the effects found in a calibration.

A quarter of the false alarms that all rules may raise in 100 calibrations; `benchmarks.false_alarms` measures it.
"""

SUSPECTED_LEVEL = 0.02
"""p-value of a score below which an effect is solved for; `benchmarks.small_faults` measures what is missed."""

_EQUAL_GAIN = 6.0  # twice the log likelihood ratio: an explanation e^3 times less likely than the best is rejected
_VERY_STRONG_GAIN = 10.0  # of twice the log ratio of evidences (Kass & Raftery 1995)
_ROOM_M = 1.0  # [m] edge of the cube in which copies may be; assumed
LEAST_CHANCE = 1e-300
"""Smallest p-value that is computed directly: the smallest normal double is 2e-308."""


def compare_nested_models(
    gain: float, freedoms: float, level: float = SINGLE_LEVEL, noise_freedoms: float = np.inf
) -> Comparison:
    """Compare a wider model with the model in use by its gain.

    Args:
        gain: Twice the log likelihood ratio, or the score: chi-square distributed if the model in use is true.
        freedoms: Degrees of freedom of the chi-square.
        level: Significance level at which the wider model is taken.
        noise_freedoms: Degrees of freedom of the estimated noise; infinite if the noise is stated.
    """
    return decide(gain, log_chance(gain, freedoms, noise_freedoms), level)


def log_chance(statistic: float, freedoms: float, noise_freedoms: float = np.inf) -> float:
    """Log p-value of a chi-square statistic; 0 without degrees of freedom or gain.

    For estimated noise, the F distribution is used, unless its tail probability underflows.
    """
    if freedoms < 1 or statistic <= 0:
        return 0.0
    known = np.isinf(noise_freedoms)
    chance = chdtrc(freedoms, statistic) if known else fdtrc(freedoms, noise_freedoms, statistic / freedoms)
    if chance > LEAST_CHANCE:
        return float(np.log(chance))
    # The first term of the asymptotic expansion of the tail: Abramowitz & Stegun 6.5.32.
    return float(-0.5 * statistic + (0.5 * freedoms - 1) * np.log(0.5 * statistic) - gammaln(0.5 * freedoms))


def compare_evidence(gain: float) -> Comparison:
    """Compare a wider model with the model in use by its gain, twice the log ratio of evidences (an e-value)."""
    decision = Decision.TAKE if gain > _VERY_STRONG_GAIN else Decision.KEEP
    return Comparison(gain, -0.5 * gain, decision)


def compare_likelihoods(log_ratios: Array) -> Comparison:
    """Compare a rival model with the model in use by log likelihood ratios, for each value of an unknown parameter.

    Neither model is simpler: the rival is taken at the level `SUSPECTED_LEVEL`.

    Args:
        log_ratios: (n,) log likelihood ratio for each parameter value; all values are equally probable.
    """
    log_mean = float(np.logaddexp.reduce(log_ratios) - np.log(len(log_ratios)))
    return decide(2 * float(np.max(log_ratios)), -log_mean, SUSPECTED_LEVEL)


def compare_split(ratio: float, count: int, width: int) -> Comparison:
    """Compare two means of unknown members with a single mean, by the remaining sum of squares.

    Each split of the items is a test. By Bonferroni, the p-value is at most that of one split times the number of
    splits.

    Args:
        ratio: Sum of squares about the two means over that about the single mean.
        count: Number of items.
        width: Number of values of each item.
    """
    noise_freedoms = width * (count - 2)
    gain = (1 / max(ratio, LEAST_CHANCE) - 1) * noise_freedoms
    return decide(gain, log_chance(gain, width, noise_freedoms) + (count - 1) * np.log(2), SINGLE_LEVEL)


def compare_places(offset: Array, covariance: Array) -> Comparison:
    """Test two independent estimates for the same place; taken if a wrong estimate is unlikely to be as near.

    An estimate from a copy of an object may be anywhere in a room. The ratio of evidences is the density of the offset
    under one place over the uniform density in the room. Directions with a sigma as large as the room have no effect.

    Args:
        offset: (3,) difference of the estimates [m].
        covariance: (3, 3) covariance of the difference [m^2].
    """
    eigen = scaled_spectrum(covariance, 1.0)
    width = _ROOM_M / np.sqrt(2 * np.pi * eigen.values)
    gain = np.sum(2 * np.log(np.maximum(width, 1.0))) - np.sum((offset @ eigen.vectors) ** 2 / eigen.values)
    return compare_evidence(float(gain))


def largest_posterior(log_chance: float) -> float:
    """Largest posterior probability of a wider model, from its log p-value and a prior probability of 1/2.

    Source: docs/mathematics.md (11.7).
    """
    log_chance = min(log_chance, -1.0)
    return float(1 / (1 - log_chance * np.exp(1 + log_chance)))


def discoveries(log_chances: Sequence[float], tests: int, share: float) -> BoolArray:
    """Mask of the discovered effects of a family of tests, (n,).

    The expected share of false discoveries is at most `share` (Benjamini & Hochberg 1995). If there is no effect at
    all, `share` is the probability that any effect of the family is discovered.

    Args:
        log_chances: (n,) log p-values of candidate effects; the other tests of the family count as not discovered.
        tests: Number of tests of the family.
        share: Accepted share of false discoveries.
    """
    order = np.argsort(log_chances)
    limits = np.log(share * np.arange(1, len(order) + 1) / max(tests, 1))
    below = np.flatnonzero(np.asarray(log_chances)[order] < limits)
    found = np.zeros(len(order), dtype=bool)
    found[order[: below[-1] + 1 if len(below) else 0]] = True
    return found


def equally_likely(costs: Sequence[float]) -> list[int]:
    """Indices of the explanations that the data do not distinguish from the best one, including the best.

    Args:
        costs: (n,) minus twice the log likelihood of each explanation, plus its degrees of freedom.
    """
    best = min(costs, default=0.0)
    return [k for k, cost in enumerate(costs) if cost < best + _EQUAL_GAIN]


class Decision(Enum):
    """Decision between a rival model and the model in use."""

    KEEP = "the model in use"
    UNDECIDED = "either"
    TAKE = "the rival"


@dataclass(frozen=True)
class Comparison:
    """Comparison of a rival model with the model in use.

    Attributes:
        gain: Twice the log ratio of the likelihoods, or of the evidences, of the rival over the model in use.
        log_chance: Logarithm of the p-value of the gain, or of the inverse e-value.
        decision: Decision between the two models.
    """

    gain: float
    log_chance: float
    decision: Decision

    @property
    def chance(self) -> float:
        """The p-value of the gain, or the inverse e-value."""
        return float(np.exp(min(self.log_chance, 0.0)))

    @property
    def is_taken(self) -> bool:
        """Whether the rival is taken."""
        return self.decision is Decision.TAKE


def decide(gain: float, log_chance: float, level: float, doubtful_level: float = 0.0) -> Comparison:
    """Decide between a rival model and the model in use by a p-value.

    Args:
        gain: Gain of the rival; see `Comparison`.
        log_chance: Log p-value of the gain; see `Comparison`.
        level: p-value below which the rival is taken.
        doubtful_level: p-value below which the comparison is undecided.
    """
    below = Decision.UNDECIDED if np.exp(min(log_chance, 0.0)) < doubtful_level else Decision.KEEP
    return Comparison(gain, log_chance, Decision.TAKE if log_chance < np.log(level) else below)
