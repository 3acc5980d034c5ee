"""Measurements of target poses from another program."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from basecal.estimation.view.measurement import (
    Noise,
    ViewInformation,
    make_information,
    take_batch_rows,
)
from basecal.estimation.view.pose_errors import CornerErrors
from basecal.geometry import SE3, Array, BoolArray, Camera, IntArray, Rows
from basecal.geometry.se3_jacobians import right_jacobian_inverse
from basecal.numerics.batch import take


@dataclass(frozen=True, eq=False)
class PoseMeasurement:
    """Target poses measured by another program.

    Attributes:
        measured_camera_from_target: (n,) measured poses.
        stated: (n, 6) 1 / sigma, or 0 if none was stated [1/m, 1/rad].
        weight: (n, 6) 1 / sigma in use [1/m, 1/rad].
        corners: Error model as a function of the view; None if errors are right tangents.
    """

    measured_camera_from_target: SE3
    stated: Array
    weight: Array
    corners: CornerErrors | None = None

    def _error(self, camera_from_target: SE3) -> Array:
        """Errors scaled to equal sigmas in all views, (n, 6) [m, rad]."""
        if self.corners is not None:
            return self.corners.differences(self.measured_camera_from_target, camera_from_target)
        return (self.measured_camera_from_target.inverse() @ camera_from_target).log()

    def linearise(self, camera_from_target: SE3, camera: Camera | None, with_lens: bool) -> ViewInformation:
        """See `Measurement`."""
        error = self._error(camera_from_target)
        by_pose = right_jacobian_inverse(error) if self.corners is None else self.corners.jacobian(camera_from_target)
        return make_information(self.weight * error, (self.weight[..., None] * by_pose).mT)

    def squares(self, camera_from_target: SE3, camera: Camera | None) -> dict[str, float]:
        """See `Measurement`."""
        squared = (self._error(camera_from_target) * self.weight * (self.stated == 0)) ** 2
        return {"pose_m": float(squared[:, :3].sum()), "pose_rad": float(squared[:, 3:].sum())}

    def with_noise(self, noise: Noise) -> PoseMeasurement:
        """See `Measurement`."""
        default = 1 / np.array([noise.pose_m] * 3 + [noise.pose_rad] * 3)
        return replace(self, weight=np.where(self.stated == 0, default, self.stated))

    def noisier(self, factor: float) -> PoseMeasurement:
        """See `Measurement`."""
        return replace(self, weight=self.weight / factor)

    def take(self, views: Rows) -> PoseMeasurement:
        """See `Measurement`."""
        return take(self, views)

    def mask_points(self, points: BoolArray) -> PoseMeasurement:
        """See `Measurement`."""
        return self

    def without_sigmas(self) -> PoseMeasurement:
        """See `Measurement`."""
        return replace(self, stated=np.zeros_like(self.stated))

    def point_counts(self) -> IntArray:
        """See `Measurement`."""
        return np.zeros(self.weight.shape[:-1], dtype=np.int64)

    def take_batch(self, rows: Rows) -> PoseMeasurement:
        """See `Measurement`."""
        measured = self.measured_camera_from_target
        measured = measured[rows] if len(measured.shape) > 1 else measured
        corners = None if self.corners is None else self.corners.take_batch(rows)
        return PoseMeasurement(
            measured, take_batch_rows(self.stated, rows, 2), take_batch_rows(self.weight, rows, 2), corners
        )

    def least_rotation_weight(self) -> Array:
        """Lower bound of 1 / sigma over all directions of each view's rotation, (n,) [1/rad]."""
        least = self.weight[:, 3:].min(1)
        if self.corners is None:
            return np.asarray(least)
        inverse = np.linalg.inv(self.corners.jacobian(self.measured_camera_from_target)[:, 3:, 3:])
        # The Frobenius norm bounds the inverse of the smallest singular value.
        return np.asarray(least / np.linalg.norm(inverse, axis=(1, 2)))

    def equations(self) -> IntArray:
        """See `Measurement`."""
        return np.full(self.weight.shape[:-1], 6, dtype=np.int64)

    def counts(self) -> dict[str, int]:
        """See `Measurement`."""
        is_unstated = self.stated == 0
        t, r = int(np.count_nonzero(is_unstated[:, :3])), int(np.count_nonzero(is_unstated[:, 3:]))
        return {"stated": is_unstated.size - t - r, "pose_m": t, "pose_rad": r}
