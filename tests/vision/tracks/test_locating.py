"""Tests of locating a camera by points of a known scene."""

from __future__ import annotations

import numpy as np

from basecal.geometry import SE3, Array, Camera
from basecal.vision.tracks.features import DESCRIPTOR_LENGTH, Features
from basecal.vision.tracks.locating import FEWEST_POINTS, Located, locate_camera

LENS = Camera("pinhole", np.array([600.0, 600.0, 319.5, 239.5, -0.1, 0.02, 0.0, 0.0, 0.0]), (640, 480))
POSE = SE3.from_rpy((0.1, -0.2, 0.3), (0.05, -0.02, 0.8))


def locate_scene(count: int, wrong: float, noise_px: float = 0.3) -> tuple[Located | None, Array]:
    """Located camera for points on a table of which a share is mistaken, and the true order."""
    rng = np.random.default_rng(3)
    points = rng.uniform(-0.2, 0.2, (count, 3)) * [1, 1, 0.2]
    looks = np.abs(rng.standard_normal((count, DESCRIPTOR_LENGTH)))
    looks = (looks / np.linalg.norm(looks, axis=1, keepdims=True)).astype(np.float32)
    pixels = LENS.project(POSE @ points)
    order = np.arange(count)
    mistaken = rng.choice(count, int(wrong * count), replace=False)
    order[mistaken] = np.roll(order[mistaken], 1)
    features = Features(pixels + noise_px * rng.standard_normal(pixels.shape), looks[order])
    return locate_camera(features, looks, points, LENS), order


def test_pose_is_found_despite_wrong_matches() -> None:
    """With half of the matches wrong the pose is found to 2 mm and 0.3 deg, and the wrong ones are excluded."""
    found, order = locate_scene(200, 0.5)
    assert found is not None
    off = (POSE.inverse() @ found.camera_from_world).log()
    assert np.linalg.norm(off[:3]) < 2e-3
    assert np.degrees(np.linalg.norm(off[3:])) < 0.3
    assert np.mean(found.point == found.feature) > 0.95
    assert len(found.point) > 90
    assert len(order) == 200


def test_few_points_give_no_pose() -> None:
    """One point less than required, or only wrong matches, give no pose."""
    assert locate_scene(FEWEST_POINTS - 1, 0.0)[0] is None
    assert locate_scene(200, 1.0)[0] is None


def test_thirty_points_give_a_pose() -> None:
    """All of the points are its inliers."""
    found, _ = locate_scene(FEWEST_POINTS, 0.0)
    assert found is not None
    assert sorted(found.point.tolist()) == list(range(FEWEST_POINTS))
    assert np.linalg.norm((POSE.inverse() @ found.camera_from_world).log()) < 0.02


def test_distant_pixels_are_not_inliers() -> None:
    """Points more than 3 px off are no inliers."""
    for off_px, count in ((2.0, 0), (6.0, 20)):
        rng = np.random.default_rng(3)
        points = rng.uniform(-0.2, 0.2, (100, 3)) * [1, 1, 0.5]
        looks = np.abs(rng.standard_normal((100, DESCRIPTOR_LENGTH)))
        looks = (looks / np.linalg.norm(looks, axis=1, keepdims=True)).astype(np.float32)
        pixels = LENS.project(POSE @ points)
        pixels[:20, 0] += off_px
        found = locate_camera(Features(pixels, looks), looks, points, LENS)
        assert found is not None
        assert np.count_nonzero(~np.isin(np.arange(20), found.point)) == count
        assert np.isin(np.arange(20, 100), found.point).all()
