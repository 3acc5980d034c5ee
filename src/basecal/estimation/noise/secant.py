"""A curvature that is right on average, corrected by how the slope did change over the last steps.

The average information equals the observed one to within the scatter of the data. If errors of two robots have nearly
the same effect, it is off by up to a factor of two. Steps by it alone then oscillate. Each pair of a step and of the
change of the slope over it is a symmetric correction of rank one. Source: Broyden 1967; Conn, Gould & Toint 1991 (when
to leave one out).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from basecal.geometry import Array
from basecal.numerics.spectral import floored_spectrum

_PARALLEL = 1e-8  # cosine of step and correction: below it the pair says nothing of the curvature along the step
_LEAST_LEFT = 0.2  # of the curvature along a correction that lowers it: less makes steps too long
_LEAST_CURVATURE = 1e-300  # what is regular already is not changed by it


class Secant(NamedTuple):
    """A step, (k,), and the change of the slope over it, (k,)."""

    step: Array
    change: Array


def correct_curvature(curvature: Array, secants: Sequence[Secant]) -> Array:
    """The curvature, (k, k) positive definite, that has the slope change as it did, as far as it stays regular."""
    for step, change in secants:
        off = change - curvature @ step
        along = float(off @ step)
        if abs(along) <= _PARALLEL * float(np.linalg.norm(off) * np.linalg.norm(step)):
            continue
        left = 1 + floored_spectrum(curvature, _LEAST_CURVATURE).squared_mahalanobis(off) / along
        if left > _LEAST_LEFT:
            curvature = curvature + np.outer(off, off) / along
    return curvature
