"""The transform between two arms, refined on image points of known points."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from basecal.estimation.scene.base import project_points, refine_transform
from basecal.geometry import SE3
from basecal.numerics.batch import take
from scene_points import BASE, LENS, made_scene


def test_it_is_refined_to_the_truth():
    """From 3 cm and 2 deg off, exact image points lead to a micrometre, one gross error in twenty or not."""
    scene = made_scene(1, arms=2, noise=0.0)
    second = np.flatnonzero(scene.views.camera[scene.tracks.view] == 1)
    poses = scene.truth.world_from_camera(scene.views)
    camera_from_second = (BASE.inverse() @ poses).inverse()
    pixels = scene.tracks.pixels[second].copy()
    pixels[::20] += 40.0
    sightings = replace(take(scene.tracks, second), pixels=pixels)
    start = BASE.inverse() @ SE3.exp([0.02, -0.02, 0.01, 0.02, 0.02, -0.02])
    found = refine_transform(scene.truth.points, sightings, camera_from_second, start, LENS)
    assert np.linalg.norm((BASE @ found).log()) < 5e-4


def test_points_outside_of_the_image_have_no_pixels():
    """NaN behind the camera and beside the image, else the lens's pixels."""
    scene = made_scene(2)
    camera_from_world = scene.truth.world_from_camera(scene.views).inverse()
    points = np.vstack([scene.truth.points, [[0.7, 0.0, 9.0]]])
    pixels = project_points(points, camera_from_world, LENS)
    assert pixels.shape == (15, len(points), 2)
    assert np.all(np.isnan(pixels[:, -1]))
    seen = np.isfinite(pixels).all(-1)
    assert np.all((pixels[seen] > -0.5) & (pixels[seen] < np.array(LENS.size_px)))
