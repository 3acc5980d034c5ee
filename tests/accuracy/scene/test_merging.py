"""Tracks of two cameras become tracks of one scene."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from basecal.accuracy.scene.images import Images
from basecal.accuracy.scene.merging import merged_tracks, shared_points
from basecal.accuracy.scene.one_camera import OneCamera
from basecal.numerics.batch import concatenate, take
from scene_images import images_of_scene, solved_camera
from scene_joins import point_by_place, true_join, true_points
from scene_points import Scene, made_scene


@pytest.fixture(scope="module")
def scene() -> Scene:
    """Two arms before one table."""
    return made_scene(1, arms=2, count=8, points=120)


@pytest.fixture(scope="module")
def images(scene: Scene) -> Images:
    """What their cameras see."""
    return images_of_scene(scene)


@pytest.fixture(scope="module")
def ones(scene: Scene, images: Images) -> tuple[OneCamera, OneCamera]:
    """What each camera's images say."""
    return solved_camera(scene, images, 0), solved_camera(scene, images, 1)


def test_one_point_is_one_track(scene: Scene, images: Images, ones: tuple[OneCamera, OneCamera]) -> None:
    """Joined as in truth, tracks are the true ones: as many, and each of one point."""
    tracks = merged_tracks(ones, {1: true_join(scene, ones)})
    at = point_by_place(scene)
    true = np.array([at[int(v), *map(float, px)] for v, px in zip(tracks.view, tracks.pixels, strict=True)])
    pairs = np.unique(np.column_stack([tracks.point, true]), axis=0)
    assert len(pairs) == tracks.count == len(np.unique(true)) > 90


def test_shared_points_are_counted(scene: Scene, images: Images, ones: tuple[OneCamera, OneCamera]) -> None:
    """A point is shared if two views of each show it; without a join none is."""
    own = [true_points(scene, one) for one in ones]
    many = [set(np.flatnonzero(np.bincount(points) >= 2).tolist()) for points in own]
    tracks = merged_tracks(ones, {1: true_join(scene, ones)})
    assert shared_points(scene.views, tracks, 1) == (len(many[0] & many[1]), (8, 8))
    assert shared_points(scene.views, merged_tracks(ones, {}), 1) == (0, (0, 0))


def test_a_few_false_sightings_tie_nothing(scene: Scene, images: Images, ones: tuple[OneCamera, OneCamera]) -> None:
    """One image point in six that shows another point than it is said to: most of each track decide, none is mixed."""
    join = true_join(scene, ones)
    point = join.sightings.point
    rng = np.random.default_rng(2)
    wrong = rng.random(len(point)) < 1 / 6
    point = np.where(wrong, rng.permutation(point), point)
    assert ones[0].fit is not None
    mixed = replace(join, sightings=replace(join.sightings, point=point))
    right = shared_points(scene.views, merged_tracks(ones, {1: join}), 1)[0]
    assert shared_points(scene.views, merged_tracks(ones, {1: mixed}), 1)[0] > 0.85 * right


def test_two_features_of_one_view_are_no_image_of_a_point(
    scene: Scene, images: Images, ones: tuple[OneCamera, OneCamera]
) -> None:
    """No view shows a point twice in what is merged."""
    join = true_join(scene, ones)
    few = take(join.sightings, np.arange(40))
    beside = replace(few, feature=few.feature * 0)
    tracks = merged_tracks(ones, {1: replace(join, sightings=concatenate([beside, join.sightings]))})
    places = np.column_stack([tracks.view, tracks.point])
    assert len(np.unique(places, axis=0)) == len(places)
