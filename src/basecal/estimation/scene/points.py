"""Points of the scene where rays of several views meet.

`benchmarks.scene` judges its limits.
"""

from __future__ import annotations

import numpy as np

from basecal.estimation.scene.equations import sums
from basecal.estimation.scene.state import SceneState
from basecal.estimation.scene.views import SceneViews, Tracks
from basecal.geometry import Array, BoolArray

_LEAST_ANGLE_DEG = 0.3  # rms angle of a point's rays to their mean, below which its depth is noise


def triangulate(views: SceneViews, tracks: Tracks, state: SceneState) -> tuple[Array, BoolArray]:
    """The points nearest to all their rays, (p, 3) [m], and which are in front of all their cameras and well seen."""
    world_from_camera = state.world_from_camera(views)
    direction, valid = views.directions(tracks, state.lenses)
    ray = (world_from_camera.rotation[tracks.view] @ direction[..., None])[..., 0]
    centre = world_from_camera.translation[tracks.view]
    across = np.eye(3) - ray[:, :, None] * ray[:, None, :]
    count = tracks.count
    whole: Array = sums(tracks.point, count, across) + 1e-12 * np.eye(3)
    points = np.linalg.solve(whole, sums(tracks.point, count, across @ centre[..., None]))[..., 0]
    mean = sums(tracks.point, count, ray)
    mean /= np.maximum(np.linalg.norm(mean, axis=1, keepdims=True), 1e-12)
    sine = np.linalg.norm(np.cross(ray, mean[tracks.point]), axis=1)
    rms = np.sqrt(sums(tracks.point, count, sine[:, None] ** 2)[:, 0] / np.maximum(np.bincount(tracks.point), 1))
    behind = np.vecdot(ray, points[tracks.point] - centre) <= 0
    is_lost = np.bincount(tracks.point, behind | ~valid, minlength=count) > 0
    return np.asarray(points, dtype=np.float64), (rms > np.radians(_LEAST_ANGLE_DEG)) & ~is_lost
