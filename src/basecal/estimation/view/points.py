"""A target's points measured in 3-D."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from basecal.estimation.view.measurement import Noise, ViewInformation, at_most_six, of_batch_rows, sums_of_squares
from basecal.estimation.view.moments import UPPER
from basecal.estimation.view.target_points import TargetPoints
from basecal.geometry import SE3, Array, BoolArray, Camera, IntArray, Rows


@dataclass(frozen=True, eq=False)
class PointMeasurement(TargetPoints):
    """A target's points in 3-D.

    Attributes:
        points_in_camera: ([b,] n, p, 3) [m]; anything finite where not seen.
        seen: (n, p) whether the point was seen.
        stated: (n, p) 1 / sigma, or 0 where none was stated [1/m].
        weight: (n, p) 1 / sigma in use, 0 where not seen [1/m].
    """

    points_in_camera: Array
    seen: BoolArray
    stated: Array
    weight: Array

    def _error(self, camera_from_target: SE3) -> Array:
        return self.in_camera(camera_from_target) - self.points_in_camera

    def linearise(self, camera_from_target: SE3, camera: Camera | None, lens: bool) -> ViewInformation:
        """See `Measurement`."""
        error = self._error(camera_from_target)
        residual = [error[..., i] * self.weight for i in range(3)]
        weight2 = np.broadcast_to(self.weight * self.weight, error.shape[:-1])
        squares = (weight2 * float(i == j) for i, j in UPPER)
        forces = (r * self.weight for r in residual)
        return self.information(sums_of_squares(residual), forces, squares, camera_from_target.rotation)

    def squares(self, camera_from_target: SE3, camera: Camera | None) -> dict[str, float]:
        """See `Measurement`."""
        unstated = self.weight * (self.stated == 0)
        return {"point_m": float(np.sum((self._error(camera_from_target) * unstated[..., None]) ** 2))}

    def with_noise(self, noise: Noise) -> PointMeasurement:
        """See `Measurement`."""
        return replace(self, weight=self.stated + (self.seen & (self.stated == 0)) / noise.point_m)

    def noisier(self, factor: float) -> PointMeasurement:
        """See `Measurement`."""
        return replace(self, weight=self.weight / factor)

    def of_batch(self, rows: Rows) -> PointMeasurement:
        """See `Measurement`."""
        seen = self.seen[rows] if self.seen.ndim > 2 else self.seen
        points, stated = of_batch_rows(self.points_in_camera, rows, 3), of_batch_rows(self.stated, rows, 2)
        weight = of_batch_rows(self.weight, rows, 2)
        return replace(self, points_in_camera=points, seen=seen, stated=stated, weight=weight)

    def equations(self) -> IntArray:
        """See `Measurement`."""
        return at_most_six(3 * np.count_nonzero(self.seen, axis=-1))

    def counts(self) -> dict[str, int]:
        """See `Measurement`."""
        stated = int(np.count_nonzero(self.stated))
        return {"stated": 3 * stated, "point_m": 3 * (int(np.count_nonzero(self.seen)) - stated)}
