"""Measurements of a target's points in 3-D."""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Self

import numpy as np

from basecal.estimation.view.measurement import Measurement, Noise, ViewInformation, sums_of_squares
from basecal.estimation.view.moments import UPPER
from basecal.estimation.view.target_points import SeenPoints
from basecal.geometry import SE3, Array, BoolArray, Camera


@dataclass(frozen=True, eq=False)
class PointMeasurement(SeenPoints):
    """Points of a target measured in 3-D.

    Attributes:
        points_in_camera: ([b,] n, p, 3) [m]; any finite values for points that are not seen.
        seen: (n, p) whether the point was seen.
        stated: (n, p) 1 / sigma, or 0 if none was stated [1/m].
        weight: (n, p) 1 / sigma in use, 0 for points that are not seen [1/m].
    """

    points_in_camera: Array
    seen: BoolArray
    stated: Array
    weight: Array
    coordinates = 3
    noise_field = "point_m"
    axes = MappingProxyType({"points_in_camera": 3, "seen": 2, "stated": 2, "weight": 2})

    def residuals(self, camera_from_target: SE3, camera: Camera | None) -> Array:
        """See `SeenPoints`."""
        return self.camera_points(camera_from_target) - self.points_in_camera

    def with_derivatives(
        self, points_in_camera: Array, camera: Camera | None, with_lens: bool
    ) -> tuple[Array, Array, Array | None]:
        """See `SeenPoints`."""
        return points_in_camera - self.points_in_camera, np.broadcast_to(np.eye(3), (*points_in_camera.shape, 3)), None

    def linearise(self, camera_from_target: SE3, camera: Camera | None, with_lens: bool) -> ViewInformation:
        """See `Measurement`."""
        error = self.residuals(camera_from_target, camera)
        residual = [error[..., i] * self.weight for i in range(3)]
        weight2 = np.broadcast_to(self.weight * self.weight, error.shape[:-1])
        squares = (weight2 * float(i == j) for i, j in UPPER)
        forces = (r * self.weight for r in residual)
        return self.information(sums_of_squares(residual), forces, squares, camera_from_target.rotation)

    def with_noise(self, noise: Noise) -> Self:
        """See `Measurement`."""
        return replace(self, weight=self.stated + (self.seen & (self.stated == 0)) / getattr(noise, self.noise_field))


class TouchMeasurement(PointMeasurement):
    """Points touched by a tip; the measured points are at the origin of the tip."""

    noise_field = "touch_m"


def is_touch(measurement: Measurement) -> bool:
    """Whether all points are measured at the origin of the camera frame, such as points touched by a tip."""
    return isinstance(measurement, PointMeasurement) and not np.any(measurement.points_in_camera)
