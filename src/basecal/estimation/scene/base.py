"""The transform between the frames of two arms, refined on image points that one shows of the other's points."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from basecal.geometry import SE3, Array, Camera, IntArray

_TAIL_PX = 3.0  # [px] from which on an image point counts less
_MOST_STEPS = 10
_STEP = 1e-6  # [m, rad] of a difference that gives a slope


class Sightings(NamedTuple):
    """Image points of known points: view, point and pixels, (n,), (n,) and (n, 2) [px]."""

    view: IntArray
    point: IntArray
    pixels: Array


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
    points: Array, sightings: Sightings, camera_from_second: SE3, second_from_first: SE3, lens: Camera
) -> SE3:
    """`second_from_first` at which image points are nearest to the points that they show.

    Args:
        points: (p, 3) in the first frame [m].
        sightings: Image points.
        camera_from_second: (v,) of the views.
        second_from_first: Where to start.
        lens: Of these views.
    """
    own = points[sightings.point]
    camera = camera_from_second[sightings.view]

    def residuals(transform: SE3) -> Array:
        """Residuals, (2 n,) [px]."""
        at = (camera @ transform).rotation @ own[..., None]
        place = at[..., 0] + (camera @ transform).translation
        return np.asarray(np.nan_to_num(lens.project(place) - sightings.pixels, nan=1e3).ravel())

    for _ in range(_MOST_STEPS):
        now = residuals(second_from_first)
        slope = np.stack(
            [(residuals(second_from_first @ SE3.exp(_STEP * axis)) - now) / _STEP for axis in np.eye(6)], -1
        )
        weight = np.repeat(1 / (1 + np.sum(now.reshape(-1, 2) ** 2, 1) / _TAIL_PX**2), 2)
        information = slope.T @ (weight[:, None] * slope)
        step = -np.linalg.solve(information + 1e-9 * np.diag(np.diag(information) + 1e-12), slope.T @ (weight * now))
        second_from_first = second_from_first @ SE3.exp(step)
        if np.abs(step).max() < _STEP:
            break
    return second_from_first
