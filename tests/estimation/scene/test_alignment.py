"""Tests of transforms between two point clouds with partly wrong pairs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from basecal.estimation.scene.alignment import alignments, are_equal, project_points, refine_transform
from basecal.geometry import SE3
from basecal.numerics.batch import take
from scene_points import BASE, LENS, made_scene

TWIN = SE3.from_rpy((0.0, 0.0, 1.0), (0.3, 0.2, 0.0))


def make_clouds(rng, right, wrong):
    """Points of the first arm and their partners in the second, some of which are wrong."""
    first = rng.uniform(-0.5, 0.5, (right + wrong, 3))
    second = BASE.inverse() @ first + 1e-3 * rng.standard_normal(first.shape)
    second[right:] = rng.uniform(-0.5, 0.5, (wrong, 3)) + BASE.inverse().translation
    return first, second


def test_third_of_right_pairs_suffices():
    """With 60 of 180 pairs right, the transform is found to 3 mm."""
    first, second = make_clouds(np.random.default_rng(1), 60, 120)
    best, agrees = alignments(first, second, np.full(180, 0.01), 5)[0]
    assert np.linalg.norm((BASE @ best).log()) < 3e-3
    assert agrees[:60].mean() > 0.9


def clouds_with_twin(right, twins):
    """Point clouds whose last points belong to an object at a second place."""
    first, second = make_clouds(np.random.default_rng(2), right, twins)
    second[right:] = BASE.inverse() @ (TWIN @ first[right:])
    return first, second


def test_repeated_object_gives_a_second_transform():
    """An object at two places gives a second transform, separate from the first."""
    first, second = clouds_with_twin(80, 40)
    found = alignments(first, second, np.full(120, 0.01), 5)
    assert int(found[0][1].sum()) >= 80
    assert found[1][1][80:].mean() > 0.9
    assert np.linalg.norm((TWIN.inverse() @ BASE @ found[1][0]).log()) < 0.02


def test_random_pairs_have_no_transform():
    """Among random pairs no transform has eight that agree within 2 mm."""
    rng = np.random.default_rng(3)
    first, second = rng.uniform(-1, 1, (60, 3)), rng.uniform(-1, 1, (60, 3))
    assert alignments(first, second, np.full(60, 2e-3), 5) == []
    assert alignments(first[:4], second[:4], np.full(4, 1.0), 5) == []


def test_transform_is_refined_to_the_truth():
    """From 3 cm and 2 deg off, image points lead to 0.5 mm, with one gross error in twenty."""
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


def test_points_outside_the_image_have_no_pixels():
    """Pixels are NaN behind the camera and beside the image, else those of the lens."""
    scene = made_scene(2)
    camera_from_world = scene.truth.world_from_camera(scene.views).inverse()
    points = np.vstack([scene.truth.points, [[0.7, 0.0, 9.0]]])
    pixels = project_points(points, camera_from_world, LENS)
    assert pixels.shape == (15, len(points), 2)
    assert np.all(np.isnan(pixels[:, -1]))
    seen = np.isfinite(pixels).all(-1)
    assert np.all((pixels[seen] > -0.5) & (pixels[seen] < np.array(LENS.size_px)))


def test_number_of_transforms_is_limited():
    """The first is the one that most pairs agree with. A pair counts within its own tolerance."""
    first, second = clouds_with_twin(40, 80)
    both = alignments(first, second, np.full(120, 0.01), 2)
    assert [int(mask.sum()) for _, mask in both] == sorted((int(mask.sum()) for _, mask in both), reverse=True)
    assert both[0][1][40:].all()
    assert both[1][1][:40].all()
    (only,) = alignments(first, second, np.full(120, 0.01), 1)
    np.testing.assert_array_equal(only[1], both[0][1])
    tight = np.full(120, 0.01)
    tight[:40] = 1e-9
    assert len(alignments(first, second, tight, 5)) == 1


@pytest.mark.parametrize("count", [7, 8])
def test_transform_needs_eight_pairs(count):
    """Seven do not suffice, however well they agree, also among others."""
    rng = np.random.default_rng(4)
    first = rng.uniform(-1, 1, (count, 3))
    second = BASE.inverse() @ first
    found = alignments(first, second, np.full(count, 1e-3), 3)
    assert len(found) == (count == 8)
    more = np.vstack([first, [[9.0, 9.0, 9.0]]])
    assert len(alignments(more, np.vstack([second, [[0.0, 0, 0]]]), np.full(count + 1, 1e-3), 3)) == (count == 8)
    if found:
        np.testing.assert_allclose((BASE @ found[0][0]).log(), 0, atol=1e-9)


@pytest.mark.parametrize(("step", "is_one"), [
    ([0.049, 0, 0, 0, 0, 0], True), ([0.051, 0, 0, 0, 0, 0], False), ([0, 0, 0, 0, 0, 0.049], True),
    ([0, 0, 0, 0, 0, 0.051], False),
])  # fmt: skip
def test_transforms_are_compared_by_the_median_point(step, is_one):
    """The distance of the median point and the angle count, and a distant point is only one of many."""
    points = np.array([[0.0, 0, 0], [0.1, 0.1, 0.1], [-0.1, -0.1, -0.1], [50.0, 50.0, 50.0], [-50.0, 9.0, 0.0]])
    assert are_equal(BASE, BASE @ SE3.exp(step), points, 0.05) == is_one
    assert are_equal(BASE @ SE3.exp(step), BASE, points, 0.05) == is_one


def test_points_are_projected_to_each_view():
    """The projection uses the lens and the pose of each view."""
    scene = made_scene(2)
    camera_from_world = scene.truth.world_from_camera(scene.views).inverse()
    pixels = project_points(scene.truth.points, camera_from_world, LENS)
    expected = LENS.project(camera_from_world[4] @ scene.truth.points)
    seen = np.isfinite(pixels[4]).all(-1)
    assert seen.sum() > 20
    np.testing.assert_allclose(pixels[4][seen], expected[seen], atol=1e-9)
