"""A target's points measured in 3-D."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from basecal.estimation.view.measurement import (
    Noise,
    ViewInformation,
    at_most_six,
    in_camera,
    of_batch_rows,
    sums_of_squares,
)
from basecal.estimation.view.moments import UPPER, gradient_and_information, monomials
from basecal.geometry import SE3, Array, BoolArray, Camera, IntArray, Rows
from basecal.numerics.batch import SHARED


@dataclass(frozen=True, eq=False)
class PointMeasurement:
    """A target's points in 3-D.

    Attributes:
        points_in_target: (p, 3) [m].
        points_in_camera: ([b,] n, p, 3) [m]; anything finite where not seen.
        seen: (n, p) whether the point was seen.
        stated: (n, p) 1 / sigma, or 0 where none was stated [1/m].
        weight: (n, p) 1 / sigma in use, 0 where not seen [1/m].
    """

    points_in_target: Array = field(metadata=SHARED)
    points_in_camera: Array
    seen: BoolArray
    stated: Array
    weight: Array

    def _error(self, camera_from_target: SE3) -> Array:
        return in_camera(camera_from_target, self.points_in_target) - self.points_in_camera

    def linearise(self, camera_from_target: SE3, camera: Camera | None, lens: bool) -> ViewInformation:
        """See `Measurement`."""
        error = self._error(camera_from_target)
        residual = [error[..., i] * self.weight for i in range(3)]
        weight2 = np.broadcast_to(self.weight * self.weight, error.shape[:-1])
        squares = (weight2 * float(i == j) for i, j in UPPER)
        forces = (r * self.weight for r in residual)
        return ViewInformation(
            sums_of_squares(residual),
            *gradient_and_information(forces, squares, camera_from_target.rotation, self._monomials),
        )

    @cached_property
    def _monomials(self) -> Array:
        return monomials(self.points_in_target)

    def squares(self, camera_from_target: SE3, camera: Camera | None) -> dict[str, float]:
        """See `Measurement`."""
        unstated = self.weight * (self.stated == 0)
        return {"point_m": float(np.sum((self._error(camera_from_target) * unstated[..., None]) ** 2))}

    def with_noise(self, noise: Noise) -> PointMeasurement:
        """See `Measurement`."""
        return replace(self, weight=self.stated + (self.seen & (self.stated == 0)) / noise.point_m)

    def take(self, views: Rows) -> PointMeasurement:
        """See `Measurement`."""
        return replace(
            self,
            points_in_camera=self.points_in_camera[views],
            seen=self.seen[views],
            stated=self.stated[views],
            weight=self.weight[views],
        )

    def of_batch(self, rows: Rows) -> PointMeasurement:
        """See `Measurement`."""
        seen = self.seen[rows] if self.seen.ndim > 2 else self.seen
        points, stated, weight = (
            of_batch_rows(self.points_in_camera, rows, 3),
            of_batch_rows(self.stated, rows, 2),
            of_batch_rows(self.weight, rows, 2),
        )
        return replace(self, points_in_camera=points, seen=seen, stated=stated, weight=weight)

    def equations(self) -> IntArray:
        """See `Measurement`."""
        return at_most_six(3 * np.count_nonzero(self.seen, axis=-1))

    def counts(self) -> dict[str, int]:
        """See `Measurement`."""
        stated = int(np.count_nonzero(self.stated))
        return {"stated": 3 * stated, "point_m": 3 * (int(np.count_nonzero(self.seen)) - stated)}
