"""Tests of `solve_camera`: mount and scene of one camera from its own images."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from basecal.accuracy.scene.checks import camera_findings
from basecal.accuracy.scene.images import Images
from basecal.accuracy.scene.one_camera import OneCamera, image_pairs, own_views, solve_camera
from basecal.geometry import SE3
from scene_images import images_of_scene, random_looks, with_inverted_poses
from scene_points import MOUNT, PIXEL, made_scene


@pytest.fixture(scope="module")
def images() -> Images:
    """Ten images of one arm."""
    return images_of_scene(made_scene(2, count=10, points=200))


@pytest.fixture(scope="module")
def solved(images: Images) -> OneCamera:
    """The solution of these images."""
    return solve_camera(images, 0, None)


def test_mount_is_found_without_guess(solved: OneCamera) -> None:
    """Features and poses alone give the mount within 3 mm and 0.2 deg, and image points fit to their noise."""
    assert solved.fit is not None
    off = (MOUNT.inverse() @ solved.fit.state.mounts[0]).log()
    assert np.linalg.norm(off[:3]) < 3e-3
    assert np.degrees(np.linalg.norm(off[3:])) < 0.2
    assert solved.fit.sigma_px == pytest.approx(PIXEL, rel=0.2)
    assert list(camera_findings("eye", replace(solved, rows=np.arange(20)))) == []


def test_features_match_image_points(images: Images, solved: OneCamera) -> None:
    """The feature of each fitted image point has its pixels and resembles the mean descriptor of its point."""
    assert solved.fit is not None
    tracks = solved.tracks
    at = [images.features[v] for v in tracks.view]
    pixels = [each.pixels[k] for each, k in zip(at, tracks.feature, strict=True)]
    np.testing.assert_array_equal(pixels, tracks.pixels)
    looks = np.array([each.descriptors[k] for each, k in zip(at, tracks.feature, strict=True)])
    alike = np.sum(looks * images.descriptors(tracks)[tracks.point], 1)
    assert alike.min() > 0.9


@pytest.mark.journey
def test_inverted_poses_are_poor_fit() -> None:
    """Poses recorded as `flange_from_base` leave features far from their epipolar lines and are a poor fit."""
    scene = made_scene(2, count=10, points=200)
    inverted = replace(scene, views=with_inverted_poses(scene.views, 0))
    found = list(camera_findings("eye", solve_camera(images_of_scene(inverted), 0, None)))
    assert [(each.code, each.severity) for each in found] == [("poor-fit", "error")]
    assert "base_from_flange" in found[0].message


@pytest.mark.journey
def test_negated_positions_are_poor_fit() -> None:
    """Negated positions fit all epipolar lines but put points behind the camera; the advice is to check the joints."""
    scene = made_scene(2, count=10, points=200)
    poses = scene.views.base_from_flange
    views = replace(scene.views, base_from_flange=SE3(poses.rotation, -poses.translation))
    (found,) = camera_findings("eye", solve_camera(images_of_scene(replace(scene, views=views)), 0, None), ["left"])
    assert (found.code, found.severity) == ("poor-fit", "error")
    assert "behind" in found.what
    assert "URDF of left" in found.message
    assert "base_from_flange" not in found.message


def test_images_without_shared_features_have_no_start() -> None:
    """If all images' features differ, no pair is matched, and there is neither start nor fit."""
    images = images_of_scene(made_scene(2, count=10, points=100))
    rng = np.random.default_rng(3)
    blank = [replace(each, descriptors=random_looks(rng, len(each))) for each in images.features]
    found = solve_camera(replace(images, features=tuple(blank)), 0, None)
    assert (found.start, found.fit, found.matched_pairs) == (None, None, 0)


def test_own_views_contain_one_camera_and_robot() -> None:
    """The views of the second camera have one camera, one robot at the origin, and stops numbered from 0."""
    views, rows = own_views(made_scene(1, arms=2, count=4, points=40).views, 1)
    np.testing.assert_array_equal(rows, [4, 5, 6, 7])
    np.testing.assert_array_equal(views.stop, [0, 1, 2, 3])
    assert [camera.name for camera in views.cameras] == ["right_eye"]
    assert views.robots == ("right",)
    assert views.bases[0].status == "fixed"


def test_many_images_are_paired_by_similar_direction() -> None:
    """Up to 60 images are all paired; more are paired with those of the most similar directions."""
    turns = SE3.exp(np.outer(np.arange(100), [0, 0, 0, 0, 0, 0.02]))
    assert len(image_pairs(turns[:60])) == 60 * 59 // 2
    pairs = image_pairs(turns)
    assert len(pairs) < 100 * 20
    assert max(j - i for i, j in pairs) <= 20
    assert {(k, k + 1) for k in range(99)} <= set(pairs)
