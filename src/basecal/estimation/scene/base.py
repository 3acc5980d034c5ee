"""The transform between the frames of two arms, refined on image points that one shows of the other's points.

`benchmarks.scene` judges its limits.
"""

from __future__ import annotations

import numpy as np

from basecal.estimation.scene.views import Tracks
from basecal.geometry import SE3, Array, Camera
from basecal.numerics.robust_step import STEP, robust_step

_TAIL_PX = 3.0  # [px] from which on an image point counts less
_MOST_STEPS = 10


def project_points(points: Array, camera_from_first: SE3, lens: Camera) -> Array:
    """Pixels of points in each of v views, (v, p, 2); NaN where the lens or the image does not show them.

    Args:
        points: (p, 3) [m].
        camera_from_first: (v,) of the frame of the points.
        lens: The lens.
    """
    at = np.einsum("vab,pb->vpa", camera_from_first.rotation, points) + camera_from_first.translation[:, None]
    return np.asarray(np.where(lens.sees(at)[..., None], lens.project(at), np.nan))


def refine_transform(
    points: Array, sightings: Tracks, camera_from_second: SE3, second_from_first: SE3, lens: Camera
) -> SE3:
    """`second_from_first` at which image points are nearest to the points that they show.

    Args:
        points: (p, 3) in the first frame [m].
        sightings: Image points of them.
        camera_from_second: (v,) of the views.
        second_from_first: Where to start.
        lens: Of these views.
    """
    own = points[sightings.point]
    camera = camera_from_second[sightings.view]

    def residuals(step: Array) -> Array:
        """Residuals after a step, (n, 2) [px]."""
        moved = camera @ (second_from_first @ SE3.exp(step))
        place = (moved.rotation @ own[..., None])[..., 0] + moved.translation
        return np.asarray(np.nan_to_num(lens.project(place) - sightings.pixels, nan=1e3))

    for _ in range(_MOST_STEPS):
        step = robust_step(residuals, 6, _TAIL_PX)
        second_from_first = second_from_first @ SE3.exp(step)
        if np.abs(step).max() < STEP:
            break
    return second_from_first
