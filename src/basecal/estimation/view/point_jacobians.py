"""Points of views one by one: residuals and derivatives that a view's information sums over."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from basecal.estimation.view.measurement import Measurement
from basecal.estimation.view.pixels import PixelMeasurement
from basecal.estimation.view.points import PointMeasurement
from basecal.estimation.view.target_points import needed
from basecal.geometry import SE3, Array, BoolArray, Camera


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
    measurement: Measurement, camera_from_target: SE3, camera: Camera | None, lens: bool
) -> PointJacobians | None:
    """Each point of views about `camera_from_target`, (n,); None where what was measured are poses."""
    if not isinstance(measurement, PixelMeasurement | PointMeasurement):
        return None
    points = camera_from_target.translation[:, None] + measurement.points_in_target @ np.swapaxes(
        camera_from_target.rotation, -1, -2
    )
    if isinstance(measurement, PointMeasurement):
        off, by_lens = points - measurement.points_in_camera, None
        by_point: Array = np.broadcast_to(np.eye(3), (*points.shape, 3))
    else:
        pixels, by_point, by_lens = needed(camera).project_with_derivatives(points, lens)
        off = pixels - measurement.pixels
    seen = measurement.seen & (measurement.weight > 0) & np.isfinite(off).all(-1)
    weight = np.where(seen, measurement.weight, 0.0)[..., None]
    # Derivative of f(camera_from_target @ p) by the pose's tangent, (n, p, d, 6), from df/dp, (n, p, d, 3).
    shift = by_point @ camera_from_target.rotation[:, None]
    by_pose = np.concatenate([shift, np.cross(measurement.points_in_target[:, None], shift)], -1)
    jacobian = by_pose if by_lens is None else np.concatenate([by_pose, by_lens], -1)
    return PointJacobians(np.nan_to_num(off) * weight, np.nan_to_num(jacobian) * weight[..., None], seen)
