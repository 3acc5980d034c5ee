"""Pairs of image points, and their distance from epipolar lines."""

from __future__ import annotations

import numpy as np

from basecal.estimation.scene.epipolar import directions, point_pairs, sampson_px
from basecal.geometry import SE3
from basecal.numerics.batch import take
from scene_points import LENS, MOUNT, made_scene


def test_distances_are_those_to_epipolar_lines():
    """Of true poses and image points without noise they are zero, of a mount 1 deg off they are pixels."""
    scene = made_scene(4, noise=0.0)
    pairs = point_pairs(scene.tracks, 200)
    poses = scene.views.base_from_flange
    rays, focal_px = directions(pairs, LENS), float(LENS.focal.mean())
    assert np.abs(sampson_px(pairs, rays, poses, MOUNT, focal_px)).max() < 1e-6
    turned = MOUNT @ SE3.from_rotvec((np.radians(1.0), 0, 0), np.zeros(3))
    assert np.median(np.abs(sampson_px(pairs, rays, poses, turned, focal_px))) > 1.0


def test_pairs_are_of_one_point_and_one_camera():
    """Both image points of each pair show the same point, in two views of the camera."""
    scene = made_scene(5, arms=2)
    second = take(scene.tracks, scene.views.camera[scene.tracks.view] == 1)
    one, other = point_pairs(second, 300)
    assert len(one) == len(other) == 300
    assert np.all(scene.views.camera[one.view] == 1)
    assert np.all(scene.views.camera[other.view] == 1)
    assert np.all(one.view != other.view)
    known = {
        (int(v), *p): q
        for v, q, p in zip(scene.tracks.view, scene.tracks.point, scene.tracks.pixels.tolist(), strict=True)
    }
    assert all(
        known[int(i), *a] == known[int(j), *b]
        for i, j, a, b in zip(one.view, other.view, one.pixels.tolist(), other.pixels.tolist(), strict=True)
    )


def test_views_of_another_order_are_other_pairs():
    """Pairs follow the views: those of a scene without its last views have none of these."""
    scene = made_scene(6)
    kept, _ = scene.tracks.take(scene.tracks.view < 10)
    assert point_pairs(kept, 500)[1].view.max() < 10
