"""The scale of squared deviations of which some are gross, and the limit beyond which one is.

The scale is the median of d^2 over its chi-square's median, taken again over what lies within the limit until that
settles. Stated sigmas are used as they are if the bulk of the deviations is consistent with them, and are never made
smaller. Unstated noise spreads unevenly over a view's directions, so that six freedoms may scatter like two. Their
effective number then follows from the median over the lower quintile, which few outliers reach.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtri, fdtri

from basecal.estimation.least_squares.studentized_residuals import MahalanobisSquared
from basecal.estimation.noise.estimate import CONTRADICTED
from basecal.geometry import Array, BoolArray, IntArray

_SCALE_ROUNDS = 10
_CHANCE_OF_SUSPECT = 1e-2  # that a good item is judged once more, by the noise of all others
# The median uses as much of a sample's information as 0.4 of it would by its mean.
_EFFICIENCY = 0.4
_SHAPES = np.linspace(1.0, 15.0, 57)
_RATIOS = chdtri(_SHAPES, 0.5) / chdtri(_SHAPES, 0.8)


@dataclass(frozen=True, eq=False)
class Scale:
    """Variance of what was taken for 1, and how many squares it rests on.

    Attributes:
        variance: The scale of squared deviations.
        freedoms: Of the estimate; infinite if it was stated.
        shape: As how many freedoms squares scatter, where these are more.
        chance: How often a clean deviation may be taken for a gross one.
    """

    variance: float
    freedoms: float
    shape: float
    chance: float

    def suspect_scale(self) -> Scale:
        """A copy for items to be judged once more: exceeded more often, its shape not estimated from few squares."""
        return replace(self, chance=_CHANCE_OF_SUSPECT, shape=np.inf)

    def limit(self, freedoms: IntArray) -> Array:
        """The squared deviation of so many freedoms that a clean one exceeds by this chance."""
        table: Array = self._limits(np.arange(int(freedoms.max(initial=0)) + 1))
        return table[freedoms]

    def _limits(self, freedoms: IntArray) -> Array:
        at = np.maximum(freedoms, 1)
        if not np.isfinite(self.freedoms):
            limit: Array = self.variance * chdtri(at, self.chance)
        else:
            alike = np.minimum(at, self.shape)
            over_median = alike * fdtri(alike, max(self.freedoms, 1.0), 1 - self.chance) / chdtri(alike, 0.5)
            limit = self.variance * chdtri(at, 0.5) * over_median
        return np.where(freedoms > 0, limit, np.inf)

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
    return as_stated if is_stated and scale.variance < CONTRADICTED**2 else scale
