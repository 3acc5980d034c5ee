"""Pairs of image points, and their distance from epipolar lines."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from basecal.estimation.scene.epipolar import point_pairs, sampson_px
from basecal.geometry import SE3
from scene_points import LENS, MOUNT, made_scene


def test_distances_are_those_to_epipolar_lines():
    """Of true poses and image points without noise they are zero, of a mount 1 deg off they are pixels."""
    scene = made_scene(4, noise=0.0)
    pairs = point_pairs(scene.views, scene.tracks, 0, 200)
    poses = scene.views.base_from_flange
    rays, focal_px = pairs.directions(LENS), float(LENS.focal.mean())
    assert np.abs(sampson_px(pairs, rays, poses, MOUNT, focal_px)).max() < 1e-6
    turned = MOUNT @ SE3.from_rotvec((np.radians(1.0), 0, 0), np.zeros(3))
    assert np.median(np.abs(sampson_px(pairs, rays, poses, turned, focal_px))) > 1.0


def test_pairs_are_of_one_point_and_one_camera():
    """Both image points of each pair show the same point, in two views of the camera."""
    scene = made_scene(5, arms=2)
    pairs = point_pairs(scene.views, scene.tracks, 1, 300)
    assert len(pairs) == 300
    assert np.all(scene.views.camera[pairs.first] == 1)
    assert np.all(scene.views.camera[pairs.second] == 1)
    assert np.all(pairs.first != pairs.second)
    known = {
        (int(v), *p): q
        for v, q, p in zip(scene.tracks.view, scene.tracks.point, scene.tracks.pixels.tolist(), strict=True)
    }
    assert all(
        known[int(i), *a] == known[int(j), *b]
        for i, j, a, b in zip(pairs.first, pairs.second, pairs.first_px.tolist(), pairs.second_px.tolist(), strict=True)
    )


def test_views_of_another_order_are_other_pairs():
    """Pairs follow the views: those of a scene without its last views have none of these."""
    scene = made_scene(6)
    kept, _ = scene.tracks.take(scene.tracks.view < 10)
    few = replace(scene.views.take(np.arange(10)), stop=np.arange(10))
    assert point_pairs(few, kept, 0, 500).second.max() < 10
