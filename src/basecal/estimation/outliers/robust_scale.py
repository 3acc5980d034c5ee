"""The scale of squared deviations of which some are gross, and the limit beyond which one is.

The scale is the median of d^2 over its chi-square's median, taken again over what lies within the limit until that
settles. Stated sigmas are used as they are if the bulk of the deviations is consistent with them, and are never made
smaller. Unstated noise spreads unevenly over a view's directions, so that six freedoms may scatter like two. Their
effective number follows from the median over the lower quintile, which few outliers reach. A few squares do not
determine it: the limit is integrated over it, weighted by its likelihood given those within. Source:
docs/mathematics.md (8.3).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtri, fdtrc, fdtri, gammaln

from basecal.estimation.least_squares.studentized_residuals import MahalanobisSquared
from basecal.estimation.noise.estimate import CONTRADICTED
from basecal.geometry import Array, BoolArray, IntArray

_SCALE_ROUNDS = 10
_CHANCE_OF_SUSPECT = 1e-2  # that a good item is judged once more, by the noise of all others
# The median uses as much of a sample's information as 0.4 of it would by its mean.
_EFFICIENCY = 0.4
_SHAPES = np.linspace(1.0, 15.0, 57)
_RATIOS = chdtri(_SHAPES, 0.5) / chdtri(_SHAPES, 0.8)
_LIKELY_SHAPES = 11  # of which the likelihood is taken, from one to all freedoms
_HALVINGS = 12  # of the interval that holds a limit: to a thousandth of it


@dataclass(frozen=True, eq=False)
class Scale:
    """Variance of what was taken for 1, and how many squares it rests on.

    Attributes:
        variance: The scale of squared deviations.
        freedoms: Of the estimate; infinite if it was stated.
        shape: As how many freedoms squares scatter, where these are more; several, (k,), if that is not known.
        chance: How often a clean deviation may be taken for a gross one.
        weight: Of each shape, (k,); their sum is 1.
    """

    variance: float
    freedoms: float
    shape: float | Array
    chance: float
    weight: float | Array = 1.0

    def suspect_scale(self) -> Scale:
        """A copy for items to be judged once more: exceeded more often, its shape not estimated from few squares."""
        return replace(self, chance=_CHANCE_OF_SUSPECT, shape=np.inf, weight=1.0)

    def limit(self, freedoms: IntArray) -> Array:
        """The squared deviation of so many freedoms that a clean one exceeds by this chance."""
        counts = np.bincount(freedoms.ravel(), minlength=1)
        table, kinds = np.full(len(counts), np.inf), np.flatnonzero(counts[1:]) + 1
        shared = np.isfinite(self.freedoms)
        table[kinds] = self._shared_limits(kinds) if shared else self.variance * chdtri(kinds, self.chance)
        limits: Array = table[freedoms]
        return limits

    def _shared_limits(self, freedoms: IntArray) -> Array:
        """Limits of a scale that was estimated, (n,): the chances of all shapes together are that of the scale."""
        alike = np.minimum(freedoms[:, None], np.atleast_1d(self.shape))
        of_scale = max(self.freedoms, 1.0)
        over_median = alike * fdtri(alike, of_scale, 1 - self.chance) / chdtri(alike, 0.5)
        low, high = over_median.min(1), over_median.max(1)
        for _ in range(_HALVINGS if np.any(low < high) else 0):
            middle = (low + high) / 2
            tails = fdtrc(alike, of_scale, middle[:, None] * chdtri(alike, 0.5) / alike)
            is_low = (tails * self.weight).sum(1) > self.chance
            low, high = np.where(is_low, middle, low), np.where(is_low, high, middle)
        limits: Array = self.variance * chdtri(freedoms, 0.5) * high
        return limits

    def gross_mask(self, squares: MahalanobisSquared) -> BoolArray:
        """Which deviations are gross; those that nothing checks are not."""
        return np.nan_to_num(squares.value, nan=0.0) > self.limit(squares.freedoms)


def robust_scale(squares: list[MahalanobisSquared], unknowns: int, is_stated: bool, chance: float) -> Scale:
    """The scale of squared deviations.

    Args:
        squares: The deviations, in any grouping.
        unknowns: How many unknowns were fitted to them.
        is_stated: Whether their sigmas were.
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
    within = np.ones(len(value), dtype=bool)
    for _ in range(_SCALE_ROUNDS):
        variance = max(float(np.median(ratio[within])), 1e-300)
        left = _EFFICIENCY * max(float(freedoms[within].sum()) - unknowns, 1.0)
        low, high = np.quantile(ratio[within], (0.2, 0.5))
        shape = float(np.interp(-high / max(low, 1e-300), -_RATIOS, _SHAPES))
        scale = Scale(variance, left, shape, chance)
        now = value <= scale.limit(freedoms)
        if not now.any() or np.array_equal(now, within):
            break
        within = now
    if is_stated and scale.variance < CONTRADICTED**2:
        return as_stated
    shapes, weights = _likely_shapes(value[within], freedoms[within])
    return replace(scale, shape=shapes, weight=weights)


def _likely_shapes(value: Array, freedoms: IntArray) -> tuple[Array, Array]:
    """As how many freedoms squares (n,) may scatter, (k,), and the likelihood of each, their variance integrated."""
    shapes = np.linspace(1.0, freedoms.max(), _LIKELY_SHAPES)
    half = np.minimum(np.arange(freedoms.max() + 1)[:, None], shapes) / 2
    half[0] = 0.5  # no square has no freedoms
    mean = np.maximum(value / freedoms, 1e-300)
    counts, sums, logs = (np.bincount(freedoms, by)[:, None] for by in (np.ones(len(mean)), mean, np.log(mean)))
    total = (counts * half).sum(0)
    log_likelihood = (counts * (half * np.log(half) - gammaln(half)) + (half - 1) * logs).sum(0)
    log_likelihood += gammaln(total) - total * np.log((half * sums).sum(0))
    weights = np.exp(log_likelihood - log_likelihood.max())
    return shapes, weights / weights.sum()
