"""Two independent estimates of a place, one of which may be deceived: by a copy of an object, or by one that moved.

A deceived estimate may be anywhere in a room. The ratio of evidences is the density of what is between the two
estimates over that of any place there. Directions of which they know no more than the room say nothing.
"""

from __future__ import annotations

import numpy as np

from basecal.accuracy.model_comparison.comparison import Comparison
from basecal.accuracy.model_comparison.nested_models import compare_evidence, compare_nested_models
from basecal.geometry import Array
from basecal.numerics.spectral import scaled_spectrum

_ROOM_M = 1.0  # [m] edge of the cube in which copies may be; assumed


def compare_places(offset: Array, covariance: Array) -> Comparison:
    """Whether two estimates are of one place; taken if no deceived one would be so near by chance.

    Args:
        offset: (3,) from one to the other [m].
        covariance: (3, 3) of it [m^2].
    """
    of = scaled_spectrum(covariance, 1.0)
    width = _ROOM_M / np.sqrt(2 * np.pi * of.values)
    gain = np.sum(2 * np.log(np.maximum(width, 1.0))) - np.sum((offset @ of.vectors) ** 2 / of.values)
    return compare_evidence("one place", float(gain))


def compare_contradiction(offset: Array, covariance: Array) -> Comparison:
    """Whether two estimates contradict one another; see `compare_places`."""
    return compare_nested_models("two places", float(offset @ np.linalg.solve(covariance, offset)), len(offset))
