"""Pairs of image points that show one point, and how far they are from the epipolar geometry of recorded poses."""

from __future__ import annotations

import numpy as np

from basecal.estimation.scene.views import Tracks
from basecal.geometry import SE3, Array, BoolArray, Camera
from basecal.geometry.rotation import cross_matrix
from basecal.numerics.batch import take

_MIXING = 7919, 10007  # a prime times a view's index modulo another spreads neighbours in time: any primes would do


PointPairs = tuple[Tracks, Tracks]
"""Image points of one camera, and other ones of the same points of the scene."""


def directions(pairs: PointPairs, lens: Camera) -> tuple[Array, Array]:
    """Unit directions of both image points, (n, 3) each; zero if the lens has none."""
    (first, is_first), (second, is_second) = (lens.undistort(each.pixels) for each in pairs)
    valid = (is_first & is_second)[:, None]
    return np.where(valid, first, 0.0), np.where(valid, second, 0.0)


def point_pairs(tracks: Tracks, max_count: int) -> PointPairs:
    """At most so many pairs of image points of a camera, of views that are not neighbours in time."""
    factor, modulus = _MIXING
    order = np.lexsort((tracks.view * factor % modulus, tracks.point))
    found = np.flatnonzero(tracks.point[order[1:]] == tracks.point[order[:-1]])
    few = found[np.unique(np.linspace(0, max(len(found) - 1, 0), min(max_count, len(found))).astype(np.int64))]
    return take(tracks, order[few]), take(tracks, order[few + 1])


def sampson_px(
    pairs: PointPairs, rays: tuple[Array, Array], base_from_flange: SE3, flange_from_camera: SE3, focal_px: float
) -> Array:
    """Distance of each pair from the epipolar geometry to first order, (n,) [px]. Source: Sampson 1982.

    Args:
        pairs: Of one camera.
        rays: Directions of both image points, (n, 3) each; see `directions`.
        base_from_flange: (v,) poses of all views.
        flange_from_camera: The mount.
        focal_px: Focal length [px].
    """
    first, second = (each / np.maximum(each[:, 2:], 1e-3) for each in rays)
    base_from_camera = base_from_flange @ flange_from_camera
    between = base_from_camera[pairs[0].view].inverse() @ base_from_camera[pairs[1].view]
    essential = cross_matrix(between.translation) @ between.rotation
    to_first, to_second = (essential @ second[..., None])[..., 0], (essential.mT @ first[..., None])[..., 0]
    slope = np.sum(to_first[:, :2] ** 2, 1) + np.sum(to_second[:, :2] ** 2, 1)
    return np.asarray(focal_px * np.sum(first * to_first, 1) / np.sqrt(slope + 1e-30))


def are_in_front(
    pairs: PointPairs, rays: tuple[Array, Array], base_from_flange: SE3, flange_from_camera: SE3
) -> BoolArray:
    """Whether the rays of each pair meet in front of both cameras, (n,); see `sampson_px`."""
    base_from_camera = base_from_flange @ flange_from_camera
    one, other = (base_from_camera[each.view] for each in pairs)
    first, second = (one.rotation @ rays[0][..., None])[..., 0], (other.rotation @ rays[1][..., None])[..., 0]
    normal, baseline = np.cross(first, second), other.translation - one.translation
    depths = [np.vecdot(np.cross(baseline, ray), normal) for ray in (second, first)]
    return np.asarray((depths[0] > 0) & (depths[1] > 0))
