"""Points of a target that a camera saw one by one, in pixels or in 3-D: what both kinds share, and their rows."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np

from basecal.estimation.view.measurement import Noise, ViewInformation
from basecal.estimation.view.target_points import MeasuredPoints
from basecal.geometry import SE3, Array, BoolArray, Camera, IntArray


class SeenPoints(MeasuredPoints):
    """Points of one target, each seen or not, in some views.

    Attributes:
        seen: ([b,] n, p) whether the point was seen.
        stated: ([b,] n, p) 1 / sigma of a coordinate, or 0 if none was stated.
        noise_field: Of `Noise`, the sigma of a coordinate without a stated one.
    """

    seen: BoolArray
    stated: Array
    noise_field: ClassVar[str]

    @abstractmethod
    def linearise(self, camera_from_target: SE3, camera: Camera | None, lens: bool) -> ViewInformation:
        """See `Measurement`."""

    @abstractmethod
    def with_noise(self, noise: Noise) -> Self:
        """See `Measurement`."""

    @abstractmethod
    def residuals(self, camera_from_target: SE3, camera: Camera | None) -> Array:
        """Predicted less seen coordinates, (n, p, d); not finite if a point cannot be seen, anything if it was not."""

    @abstractmethod
    def with_derivatives(
        self, points_in_camera: Array, camera: Camera | None, lens: bool
    ) -> tuple[Array, Array, Array | None]:
        """As `residuals`, of points (n, p, 3), with derivatives by these, (n, p, d, 3), and if `lens` by its terms."""

    def tangent_rows(
        self, camera_from_target: SE3, camera: Camera | None, lens: bool
    ) -> tuple[Array, Array, Array | None]:
        """As `with_derivatives`, about poses (n,) and by their tangent, (n, p, d, 6)."""
        off, by_point, by_lens = self.with_derivatives(self.camera_points(camera_from_target), camera, lens)
        # Of f(camera_from_target @ p), from df/dp, (n, p, d, 3).
        shift = by_point @ camera_from_target.rotation[:, None]
        return off, np.concatenate([shift, np.cross(self.points_in_target[:, None], shift)], -1), by_lens

    def squares(self, camera_from_target: SE3, camera: Camera | None) -> dict[str, float]:
        """See `Measurement`."""
        unstated = self.weight * (self.stated == 0)
        off = np.nan_to_num(self.residuals(camera_from_target, camera)) * unstated[..., None]
        return {self.noise_field: float(np.sum(off**2))}

    def mask_points(self, points: BoolArray) -> Self:
        """See `Measurement`."""
        if points.all():
            return self
        stated, weight = (np.where(points, of, 0.0) for of in (self.stated, self.weight))
        return self._with(seen=self.seen & points, stated=stated, weight=weight)

    def without_sigmas(self) -> Self:
        """See `Measurement`."""
        return self._with(stated=np.zeros_like(self.stated))

    def point_counts(self) -> IntArray:
        """See `Measurement`."""
        return np.asarray(np.count_nonzero(self.seen, axis=-1), dtype=np.int64)

    def counts(self) -> dict[str, int]:
        """See `Measurement`."""
        stated, seen = int(np.count_nonzero(self.stated)), int(np.count_nonzero(self.seen))
        return {"stated": self.coordinates * stated, self.noise_field: self.coordinates * (seen - stated)}


@dataclass(frozen=True, eq=False)
class PointJacobians:
    """Points of views.

    Attributes:
        residual: (n, p, d) predicted minus seen, over sigma; zero where not seen.
        jacobian: (n, p, d, 6 + k) its derivative to the view's tangent and, where it is free, the lens.
        seen: (n, p) whether the point was seen and lies before the camera.
    """

    residual: Array
    jacobian: Array
    seen: BoolArray


def point_jacobians(
    measurement: SeenPoints, camera_from_target: SE3, camera: Camera | None, lens: bool
) -> PointJacobians:
    """Each point of views about `camera_from_target`, (n,)."""
    off, by_pose, by_lens = measurement.tangent_rows(camera_from_target, camera, lens)
    seen = measurement.seen & (measurement.weight > 0) & np.isfinite(off).all(-1)
    weight = np.where(seen, measurement.weight, 0.0)[..., None]
    jacobian = by_pose if by_lens is None else np.concatenate([by_pose, by_lens], -1)
    return PointJacobians(np.nan_to_num(off) * weight, np.nan_to_num(jacobian) * weight[..., None], seen)
