"""An effect whose size is expected beforehand, and left uncertain in every answer that it may move."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from basecal.geometry import Array

_NODES = np.arange(-2.0, 3.0)  # of the logarithm of a sigma, in standard deviations


class SigmaPrior(NamedTuple):
    """Possible sigmas of sizes, (m, ...), and their probabilities, (m,)."""

    sigmas: Array
    shares: Array

    @classmethod
    def single_value(cls, sigma: float) -> SigmaPrior:
        """One value."""
        return cls(np.array([sigma]), np.ones(1))

    @classmethod
    def as_often_as_not(cls, sigmas: Array, kinds: int = 1) -> SigmaPrior:
        """None, or one of the others, (m, ...), equally likely; of so many independent kinds none in one case of two.

        Source: Jeffreys, Theory of Probability, 1961, ch. 5; Scott & Berger 2010 (many kinds).
        """
        none = 0.5 ** (1 / kinds)
        shares = np.append(none, np.full(len(sigmas), (1 - none) / len(sigmas)))
        return cls(np.concatenate([np.zeros_like(sigmas[:1]), sigmas]), shares)


class ExpectedSize(NamedTuple):
    """The expected sizes of a candidate.

    Attributes:
        sigma: The middle of what their sigma may be, in the unit of the candidate.
        factor: Of a standard deviation of it; 1 if it is known.
        source: Of the numbers, or `assumed`.
        is_stated: Whether the answer is that of size zero, as stated, with a covariance that covers other sizes.
            Otherwise the answer is that of the expected size, given the data.
    """

    sigma: float
    factor: float
    source: str
    is_stated: bool = False

    def prior(self, kinds: int) -> SigmaPrior:
        """The prior of their sigma: none, or one of five; of so many kinds none in one case of two."""
        return SigmaPrior.as_often_as_not(self.sigma * self.factor**_NODES, kinds)
