"""Pairs of image points that show one point, and how far they are from the epipolar geometry of recorded poses."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from basecal.estimation.scene.views import SceneViews, Tracks
from basecal.geometry import SE3, Array, BoolArray, Camera, IntArray
from basecal.geometry.rotation import cross_matrix

_MIXING = 7919, 10007  # a prime times a view's index modulo another spreads neighbours in time


@dataclass(frozen=True, eq=False)
class PointPairs:
    """Pairs of image points of one camera.

    Attributes:
        first: (n,) view of the first.
        second: (n,) view of the second.
        first_px: (n, 2) [px].
        second_px: (n, 2) [px].
    """

    first: IntArray
    second: IntArray
    first_px: Array
    second_px: Array

    def __len__(self) -> int:
        return len(self.first)

    def take(self, rows: IntArray) -> PointPairs:
        """The pairs at these indices."""
        return PointPairs(self.first[rows], self.second[rows], self.first_px[rows], self.second_px[rows])

    def directions(self, lens: Camera) -> tuple[Array, Array]:
        """Unit directions of both image points, (n, 3) each; zero if the lens has none."""
        (first, is_first), (second, is_second) = lens.undistort(self.first_px), lens.undistort(self.second_px)
        valid = (is_first & is_second)[:, None]
        return np.where(valid, first, 0.0), np.where(valid, second, 0.0)


def point_pairs(views: SceneViews, tracks: Tracks, camera: int, max_count: int) -> PointPairs:
    """At most so many pairs of image points of a camera, of views that are not neighbours in time."""
    mine = np.flatnonzero(views.camera[tracks.view] == camera)
    factor, modulus = _MIXING
    order = mine[np.lexsort((tracks.view[mine] * factor % modulus, tracks.point[mine]))]
    is_same = tracks.point[order[1:]] == tracks.point[order[:-1]]
    first, second = order[:-1][is_same], order[1:][is_same]
    few = np.unique(np.linspace(0, max(len(first) - 1, 0), min(max_count, len(first))).astype(np.int64))
    first, second = first[few], second[few]
    return PointPairs(tracks.view[first], tracks.view[second], tracks.pixels[first], tracks.pixels[second])


def sampson_px(
    pairs: PointPairs, rays: tuple[Array, Array], base_from_flange: SE3, flange_from_camera: SE3, focal_px: float
) -> Array:
    """Distance of each pair from the epipolar geometry to first order, (n,) [px]. Source: Sampson 1982.

    Args:
        pairs: Of one camera.
        rays: Directions of both image points, (n, 3) each; see `PointPairs.directions`.
        base_from_flange: (v,) poses of all views.
        flange_from_camera: The mount.
        focal_px: Focal length [px].
    """
    first, second = (each / np.maximum(each[:, 2:], 1e-3) for each in rays)
    base_from_camera = base_from_flange @ flange_from_camera
    between = base_from_camera[pairs.first].inverse() @ base_from_camera[pairs.second]
    essential = cross_matrix(between.translation) @ between.rotation
    to_first, to_second = (essential @ second[..., None])[..., 0], (essential.mT @ first[..., None])[..., 0]
    slope = np.sum(to_first[:, :2] ** 2, 1) + np.sum(to_second[:, :2] ** 2, 1)
    return np.asarray(focal_px * np.sum(first * to_first, 1) / np.sqrt(slope + 1e-30))


def are_in_front(
    pairs: PointPairs, rays: tuple[Array, Array], base_from_flange: SE3, flange_from_camera: SE3
) -> BoolArray:
    """Whether the rays of each pair meet in front of both cameras, (n,); see `sampson_px`."""
    base_from_camera = base_from_flange @ flange_from_camera
    one, other = base_from_camera[pairs.first], base_from_camera[pairs.second]
    first, second = (one.rotation @ rays[0][..., None])[..., 0], (other.rotation @ rays[1][..., None])[..., 0]
    normal, baseline = np.cross(first, second), other.translation - one.translation
    depths = [np.vecdot(np.cross(baseline, ray), normal) for ray in (second, first)]
    return np.asarray((depths[0] > 0) & (depths[1] > 0))
