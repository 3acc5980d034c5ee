"""Robust scale of squared deviations in the presence of outliers, and the limit of inliers.

The scale is the median of d^2 over the median of its chi-square distribution, repeated over the deviations within the
limit until convergence. Stated sigmas are unchanged if most deviations are consistent with them, and are never reduced.
Unstated noise differs between the directions of a view, so six degrees of freedom may scatter like two. The effective
number follows from the ratio of the median to the lower quintile, which few outliers affect. A few deviations do not
determine it: the limit is averaged over it, weighted by its likelihood given the inliers.
Source: docs/mathematics.md (8.3).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtri, fdtrc, fdtri, gammaln

from basecal.estimation.least_squares.studentized_residuals import MahalanobisSquared
from basecal.estimation.noise.estimate import CONTRADICTED
from basecal.geometry import Array, BoolArray, IntArray

_SCALE_ROUNDS = 10
_CHANCE_OF_SUSPECT = 1e-2  # rate of inliers that are tested again with the noise of all others
# Efficiency of the median relative to the mean.
_EFFICIENCY = 0.4
_SHAPES = np.linspace(1.0, 15.0, 57)
_RATIOS = chdtri(_SHAPES, 0.5) / chdtri(_SHAPES, 0.8)
_LIKELY_SHAPES = 11  # number of effective degrees of freedom with a likelihood, from one to the nominal number
_HALVINGS = 12  # bisection steps of a limit: to less than a thousandth of the interval


@dataclass(frozen=True, eq=False)
class Scale:
    """Scale of squared deviations, with the distribution of inliers.

    Attributes:
        variance: Scale of the squared deviations.
        freedoms: Degrees of freedom of the estimated scale; infinite if the noise was stated.
        shape: Upper bound of the effective degrees of freedom of a deviation; several, (k,), if it is uncertain.
        chance: False alarm rate of an inlier.
        weight: Weight of each shape, (k,), with sum 1.
    """

    variance: float
    freedoms: float
    shape: float | Array
    chance: float
    weight: float | Array = 1.0

    def suspect_scale(self) -> Scale:
        """Copy with a higher false alarm rate and nominal degrees of freedom, for items that are to be tested again."""
        return replace(self, chance=_CHANCE_OF_SUSPECT, shape=np.inf, weight=1.0)

    def limit(self, freedoms: IntArray) -> Array:
        """Limits of squared deviations, by their degrees of freedom, that inliers exceed with probability `chance`."""
        counts = np.bincount(freedoms.ravel(), minlength=1)
        table, present = np.full(len(counts), np.inf), np.flatnonzero(counts[1:]) + 1
        is_estimated = np.isfinite(self.freedoms)
        table[present] = self._shared_limits(present) if is_estimated else self.variance * chdtri(present, self.chance)
        limits: Array = table[freedoms]
        return limits

    def _shared_limits(self, freedoms: IntArray) -> Array:
        """Limits with an estimated scale, (n,): the weighted tail probability of all shapes equals `chance`."""
        effective = np.minimum(freedoms[:, None], np.atleast_1d(self.shape))
        scale_freedoms = max(self.freedoms, 1.0)
        over_median = effective * fdtri(effective, scale_freedoms, 1 - self.chance) / chdtri(effective, 0.5)
        low, high = over_median.min(1), over_median.max(1)
        for _ in range(_HALVINGS if np.any(low < high) else 0):
            middle = (low + high) / 2
            tails = fdtrc(effective, scale_freedoms, middle[:, None] * chdtri(effective, 0.5) / effective)
            is_low = (tails * self.weight).sum(1) > self.chance
            low, high = np.where(is_low, middle, low), np.where(is_low, high, middle)
        limits: Array = self.variance * chdtri(freedoms, 0.5) * high
        return limits

    def gross_mask(self, squares: MahalanobisSquared) -> BoolArray:
        """Mask of gross deviations; deviations without degrees of freedom are never gross."""
        return np.nan_to_num(squares.value, nan=0.0) > self.limit(squares.freedoms)


def robust_scale(squares: list[MahalanobisSquared], unknowns: int, is_stated: bool, chance: float) -> Scale:
    """Estimate the scale of squared deviations robustly.

    Args:
        squares: The squared deviations, in any grouping.
        unknowns: Number of unknowns that were fitted to the data.
        is_stated: Whether all sigmas are stated.
        chance: See `Scale`.
    """
    value = np.concatenate([s.value.ravel() for s in squares]) if squares else np.zeros(0)
    freedoms = np.concatenate([s.freedoms.ravel() for s in squares]) if squares else np.zeros(0, dtype=np.int64)
    kept = np.isfinite(value) & (freedoms > 0)
    value, freedoms = value[kept], freedoms[kept]
    as_stated = Scale(1.0, np.inf, np.inf, chance)
    if not len(value):
        return as_stated
    ratio = value / chdtri(np.arange(1, int(freedoms.max()) + 1), 0.5)[freedoms - 1]
    if is_stated and np.median(ratio) < CONTRADICTED**2:
        return as_stated
    is_inlier = np.ones(len(value), dtype=bool)
    for _ in range(_SCALE_ROUNDS):
        variance = max(float(np.median(ratio[is_inlier])), 1e-300)
        scale_freedoms = _EFFICIENCY * max(float(freedoms[is_inlier].sum()) - unknowns, 1.0)
        low, high = np.quantile(ratio[is_inlier], (0.2, 0.5))
        shape = float(np.interp(-high / max(low, 1e-300), -_RATIOS, _SHAPES))
        scale = Scale(variance, scale_freedoms, shape, chance)
        selected = value <= scale.limit(freedoms)
        if not selected.any() or np.array_equal(selected, is_inlier):
            break
        is_inlier = selected
    if is_stated and scale.variance < CONTRADICTED**2:
        return as_stated
    shapes, weights = _likely_shapes(value[is_inlier], freedoms[is_inlier])
    return replace(scale, shape=shapes, weight=weights)


def _likely_shapes(value: Array, freedoms: IntArray) -> tuple[Array, Array]:
    """Effective degrees of freedom of squared deviations (n,), (k,), and normalised likelihoods, (k,).

    The unknown scale is integrated out.
    """
    shapes = np.linspace(1.0, freedoms.max(), _LIKELY_SHAPES)
    half = np.minimum(np.arange(freedoms.max() + 1)[:, None], shapes) / 2
    half[0] = 0.5  # unused: each deviation has at least one degree of freedom
    mean = np.maximum(value / freedoms, 1e-300)
    counts, sums, logs = (np.bincount(freedoms, weight)[:, None] for weight in (np.ones(len(mean)), mean, np.log(mean)))
    total = (counts * half).sum(0)
    log_likelihood = (counts * (half * np.log(half) - gammaln(half)) + (half - 1) * logs).sum(0)
    log_likelihood += gammaln(total) - total * np.log((half * sums).sum(0))
    weights = np.exp(log_likelihood - log_likelihood.max())
    return shapes, weights / weights.sum()
