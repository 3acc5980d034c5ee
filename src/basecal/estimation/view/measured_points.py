"""Measurements of a target's points, each coordinate with a sigma in use: what is done to their weights and arrays."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, ClassVar, Self

import numpy as np

from basecal.estimation.view.measurement import limit_equations
from basecal.estimation.view.target_points import TargetPoints
from basecal.geometry import Array, BoolArray, IntArray, Rows


class MeasuredPoints(TargetPoints):
    """Points of one target as one camera measured them in some views; the methods are those of `Measurement`.

    Attributes:
        weight: ([b,] n, p) 1 / sigma of a coordinate in use, 0 if the point was not seen.
        coordinates: How many a point has.
        axes: How many axes each array has that may have one of a batch before them.
    """

    weight: Array
    coordinates: ClassVar[int]
    axes: ClassVar[Mapping[str, int]]

    def take_batch(self, rows: Rows | int) -> Self:
        """See `Measurement`."""
        arrays = {name: getattr(self, name) for name in self.axes}
        batched = {name: of[rows] for name, of in arrays.items() if of is not None and of.ndim > self.axes[name]}
        return self._with(**batched)

    def noisier(self, factor: float) -> Self:
        """See `Measurement`."""
        return self._with(weight=self.weight / factor)

    def mask_points(self, points: BoolArray) -> Self:
        """See `Measurement`."""
        return self._with(weight=np.where(points, self.weight, 0.0))

    def without_sigmas(self) -> Self:
        """See `Measurement`."""
        return self

    def point_counts(self) -> IntArray:
        """See `Measurement`."""
        return np.asarray(np.count_nonzero(self.weight, axis=-1), dtype=np.int64)

    def equations(self) -> IntArray:
        """See `Measurement`."""
        return limit_equations(self.coordinates * self.point_counts())

    def _with(self, **changed: Any) -> Self:
        return replace(self, **changed)
