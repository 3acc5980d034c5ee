"""Points of views one by one: residuals and derivatives that a view's information sums over."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from basecal.estimation.view.seen_points import SeenPoints
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
    measurement: SeenPoints, camera_from_target: SE3, camera: Camera | None, lens: bool
) -> PointJacobians:
    """Each point of views about `camera_from_target`, (n,)."""
    points = measurement.in_camera(camera_from_target)
    off, by_point, by_lens = measurement.with_derivatives(points, camera, lens)
    seen = measurement.seen & (measurement.weight > 0) & np.isfinite(off).all(-1)
    weight = np.where(seen, measurement.weight, 0.0)[..., None]
    # Derivative of f(camera_from_target @ p) by the pose's tangent, (n, p, d, 6), from df/dp, (n, p, d, 3).
    shift = by_point @ camera_from_target.rotation[:, None]
    by_pose = np.concatenate([shift, np.cross(measurement.points_in_target[:, None], shift)], -1)
    jacobian = by_pose if by_lens is None else np.concatenate([by_pose, by_lens], -1)
    return PointJacobians(np.nan_to_num(off) * weight, np.nan_to_num(jacobian) * weight[..., None], seen)
