"""An effect whose size is expected beforehand, and left uncertain in every answer that it may move."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from basecal.geometry import Array

_NODES = np.arange(-2.0, 3.0)  # of the logarithm of a sigma, in standard deviations


class ExpectedSize(NamedTuple):
    """The expected sizes of a candidate.

    Attributes:
        sigma: The middle of what their sigma may be, in the unit of the candidate.
        factor: Of a standard deviation of it; 1 if it is known.
        source: Of the numbers, or `assumed`.
        is_stated: Whether the answer is that of size zero, as stated, with a covariance that covers the others; else it
            is that of the size that is expected, given the data.
    """

    sigma: float
    factor: float
    source: str
    is_stated: bool = False

    @property
    def sigmas(self) -> Array:
        """Nodes of their sigma, equally likely, (5,)."""
        return np.asarray(self.sigma * self.factor**_NODES)
